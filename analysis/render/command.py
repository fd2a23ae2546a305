"""``revolve robot render``: pictures of the robot in a file."""

import argparse
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

from analysis.progress import bars
from analysis.render.picture import (
    NoPictures,
    RobotRenderer,
    Simulate,
    gait_strip,
    save_animation,
    save_picture,
)
from schema.formats.run_settings import read_with_settings
from schema.plugins.permission import allow
from schema.robot.trace import Floats

FILM_ENDING = ".gif"
PICTURE_ENDING = ".png"


def render(options: argparse.Namespace, simulate: Simulate) -> int:
    """Render a robot in neutral pose or in motion; return the exit code.

    Raises:
        NoPictures: the file name has another ending, the file cannot be written, or
            ``--gait`` exceeds the number of ticks.
        InvalidRobot: the file contains no robot.
        SimulationDiverged: the physics diverged.
        ExperimentError: no such experiment, or it does not support a sensor.
    """
    allow(options.plugins)
    out: Path = options.out
    is_film = out.suffix.lower() == FILM_ENDING
    if not is_film and out.suffix.lower() != PICTURE_ENDING:
        allowed = f"{PICTURE_ENDING}, {FILM_ENDING}"
        raise NoPictures(f"{out}: must end in one of {allowed}, got {out.suffix!r}")
    if is_film and options.gait:
        raise NoPictures(f"{out}: --gait needs a {PICTURE_ENDING} file")
    named, island = options.experiment, options.island
    robot, settings, _ = read_with_settings(
        options.file, named, island, tells_default=True
    )
    world = settings.simulation
    ticks = -(-world.evaluation_steps // world.brain_steps)
    most = ticks - ticks // 2
    if options.gait is not None and options.gait > most:
        raise NoPictures(
            f"--gait {options.gait}: must be <= {most}, the number of ticks in the "
            "second half of the evaluation"
        )
    size = (options.width, options.width * 3 // 4)
    with RobotRenderer(robot, settings, size=size) as renderer:
        if not is_film and not options.gait:
            save_picture(renderer.picture(), out)
        else:
            live = partial(simulate, robot, settings)
            _draw_motion(renderer, live, options.gait, out, world.tick_s)
    print(f"{out}: written")
    return 0


def _draw_motion(
    renderer: RobotRenderer,
    live: Callable[..., object],
    gait: int | None,
    out: Path,
    tick_s: float,
) -> None:
    """Write an animation of an evaluation, or a strip of some of its ticks."""
    poses: list[Floats] = []
    times_s: list[float] = []
    look_at = distance_m = None

    def watch(data: Any) -> None:  # noqa: ANN401 - of a library imported later
        poses.append(data.qpos.copy())
        times_s.append(data.time)

    with bars(f"simulating and rendering {out}") as bar:
        live(watch=watch)
        if gait is not None:
            # From the middle on, when the first fall is over.
            shown_from = len(poses) // 2
            poses = poses[shown_from:][:gait]
            times_s = times_s[shown_from:][:gait]
            # A fixed camera, so that the robot moves in the pictures.
            look_at, distance_m = renderer.framing(poses, (0.0, 0.0))
        shown = bar.track(poses, description="rendering")
        pictures = [
            renderer.picture(pose, look_at=look_at, distance_m=distance_m)
            for pose in shown
        ]
    if gait is None:
        save_animation(pictures, out, tick_s)
    else:
        save_picture(gait_strip(pictures, [f"{one:.2f} s" for one in times_s]), out)
