"""``revolve robot render``: pictures of the robot of a file."""

import argparse
from collections.abc import Callable
from functools import partial
from pathlib import Path

import numpy as np

from analysis.progress import bars
from analysis.render.picture import (
    NoPictures,
    RobotRenderer,
    Simulate,
    gait_strip,
    save_animation,
    save_picture,
)
from schema.experiment.document import Simulation, body_space
from schema.experiment.file import read_experiment
from schema.flags import Flags, whole_number
from schema.formats.files import read_robot, settings_of
from schema.robot.results import Floats

FILM_ENDING = ".gif"
PICTURE_ENDING = ".png"


def main(arguments: list[str], simulate: Simulate) -> int:
    """Draw a robot standing, or what it does; return the exit code.

    Args:
        arguments: the command's name, ``robot render``, first.
        simulate: the worker's.

    Returns:
        0 if the picture is there.

    Raises:
        NoPictures: nothing here can draw, an ending that is no picture's, or more
            pictures than there are ticks to show.
        InvalidRobot: a file that holds no robot.
        SimulationDiverged: the physics did.
        ExperimentError: no such experiment, or a sensor that it cannot feed.
    """
    options = _parser().parse_args(arguments[1:])
    out: Path = options.out
    is_film = out.suffix.lower() == FILM_ENDING
    if not is_film and out.suffix.lower() != PICTURE_ENDING:
        allowed = f"{PICTURE_ENDING}, {FILM_ENDING}"
        raise NoPictures(f"{out}: must end in one of {allowed}, got {out.suffix!r}")
    if is_film and options.gait:
        raise NoPictures(f"{out}: --gait is for a {PICTURE_ENDING}")
    named = options.experiment
    settings = settings_of(read_experiment(named) if named else None)
    space, world = body_space(settings.space), settings.simulation
    _check_gait(options.gait, world)
    robot = read_robot(options.file, space)
    size = (options.width, options.width * 3 // 4)
    with RobotRenderer(
        robot, space, world, settings.environment, size=size
    ) as renderer:
        if not is_film and not options.gait:
            save_picture(renderer.picture(), out)
        else:
            live = partial(simulate, robot, settings.space, world, settings.environment)
            tick_s = world.brain_steps * world.timestep_s
            _draw_motion(renderer, live, options.gait, out, tick_s)
    print(f"{out}: written")
    return 0


def _check_gait(gait: int | None, world: Simulation) -> None:
    """Refuse more pictures than there are ticks to show."""
    ticks = -(-(world.warmup_steps + world.window_steps) // world.brain_steps)
    most = ticks - ticks // 2
    if gait is not None and gait > most:
        raise NoPictures(
            f"--gait {gait}: must be <= {most}, the ticks of the second half of its "
            "life, which is drawn"
        )


def _draw_motion(
    renderer: RobotRenderer,
    live: Callable[..., object],
    gait: int | None,
    out: Path,
    tick_s: float,
) -> None:
    """Write a film of a whole life, or a strip of some of its ticks."""
    poses: list[Floats] = []
    look_at = None
    with bars(f"simulating and drawing: {out}") as bar:
        live(watch=lambda data: poses.append(data.qpos.copy()))
        if gait is not None:
            # From the middle of the life on, when the first fall is over.
            poses = poses[len(poses) // 2 :][:gait]
            # A camera that stands still: the robot is seen to go.
            look_at = np.mean([pose[:3] for pose in poses], axis=0)
        shown = bar.track(poses, description="drawing")
        pictures = [renderer.picture(pose, look_at=look_at) for pose in shown]
    if gait is None:
        save_animation(pictures, out, tick_s)
    else:
        save_picture(gait_strip(pictures), out)


def _parser() -> argparse.ArgumentParser:
    parser = Flags(
        prog="revolve robot render",
        description="Draw a robot: standing, as a strip of consecutive pictures, or "
        "(.gif) as a film of its life.",
        epilog="example: revolve robot render best.yaml best.png --gait 10",
    )
    parser.add_argument("file", type=Path, metavar="FILE")
    parser.add_argument("out", type=Path, metavar="OUT.png|OUT.gif")
    parser.add_argument(
        "--gait",
        type=whole_number(1),
        metavar="N",
        help="N pictures, one per tick of the brain from the middle of its life on, in "
        "rows of five",
    )
    parser.add_argument("--width", type=whole_number(16), default=640, metavar="PIXELS")
    parser.add_argument("--experiment", metavar="NAME|FILE.toml")
    return parser
