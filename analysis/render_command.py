"""``revolve robot render``: pictures of the robot of a file."""

import argparse
from collections.abc import Callable
from pathlib import Path
from typing import Any, Protocol

import numpy as np

from analysis.render import (
    NoPictures,
    Picture,
    Studio,
    gait_strip,
    save_film,
    save_picture,
)
from schema.environment import Environment
from schema.evaluation import Floats, Track
from schema.experiment import Simulation, Space, body_space
from schema.experiment_file import read_experiment
from schema.flags import Flags, whole_number
from schema.identity import NOBODY, Identity
from schema.robot import Robot
from schema.robot_file import read_robot, settings_of

FILM_ENDING = ".gif"
PICTURE_ENDING = ".png"


class Simulate(Protocol):
    """What the worker has: a robot, alone, through its life."""

    def __call__(
        self,
        robot: Robot,
        space: Space,
        simulation: Simulation,
        environment: Environment,
        *,
        identity: Identity = NOBODY,
        watch: Callable[[Any], None],
    ) -> Track:
        """Return its track; ``watch`` is shown the engine's state at each tick."""


def main(arguments: list[str], simulate: Simulate) -> int:
    """Draw a robot standing, or what it does; return the exit code.

    Args:
        arguments: the command's name, ``robot render``, first.
        simulate: the worker's.

    Returns:
        0 if the picture is there.

    Raises:
        NoPictures: nothing here can draw, or an ending that is no picture's.
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
    robot = read_robot(options.file, space)
    size = (options.width, options.width * 3 // 4)
    with Studio(robot, space, world, settings.environment, size=size) as studio:
        if not is_film and not options.gait:
            save_picture(studio.picture(), out)
        else:
            poses: list[Floats] = []
            simulate(
                robot,
                settings.space,
                world,
                settings.environment,
                watch=lambda data: poses.append(data.qpos.copy()),
            )
            _draw_motion(studio, poses, options.gait, out, world)
    print(f"{out}: written")
    return 0


def _draw_motion(
    studio: Studio, poses: list[Floats], gait: int | None, out: Path, world: Simulation
) -> None:
    """Write a film of all poses, or a strip of some."""
    if out.suffix.lower() == FILM_ENDING:
        pictures = _drawn(studio, poses)
        save_film(pictures, out, world.brain_steps * world.timestep_s)
        return
    # From the middle of the life on, when the first fall is over.
    chosen = poses[len(poses) // 2 :][:gait]
    # A camera that stands still: the robot is seen to go.
    middle = np.mean([pose[:3] for pose in chosen], axis=0)
    save_picture(gait_strip(_drawn(studio, chosen, middle)), out)


def _drawn(
    studio: Studio, poses: list[Floats], look_at: Floats | None = None
) -> list[Picture]:
    """Draw poses, and show that it goes on."""
    from rich.progress import track

    shown = track(poses, description="drawing", transient=True)
    return [studio.picture(pose, look_at=look_at) for pose in shown]


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
        help="N pictures, one per tick of the brain, in rows of five",
    )
    parser.add_argument("--width", type=whole_number(16), default=640, metavar="PIXELS")
    parser.add_argument("--experiment", metavar="NAME|FILE.toml")
    return parser
