"""``revolve robot render``: pictures of robots in files."""

import argparse
from collections.abc import Callable
from pathlib import Path

from msgspec.structs import replace

from analysis.progress import bars
from analysis.render.files import NoPictures, gait_strip, save_film, save_picture
from analysis.render.film import Film, Look
from analysis.render.flags import FILM_ENDINGS, PICTURE_ENDING, TRANSPARENT
from analysis.render.motion import recorded, side_by_side
from analysis.render.picture import RobotRenderer, Simulate
from schema.agent.log import tell_user
from schema.experiment.document import steps_of
from schema.experiment.settings import EvaluationSettings
from schema.formats.files import BEST
from schema.formats.run_settings import read_with_settings
from schema.plugins.permission import allow
from schema.robot.robot import Robot
from schema.robot.trace import Floats

Shown = dict[str, tuple[Robot, EvaluationSettings]]
"""Robots and their settings by name."""


def render(options: argparse.Namespace, simulate: Simulate) -> int:
    """Render robots in neutral pose or in motion; return the exit code.

    Raises:
        NoPictures: the file name has another ending, the file cannot be written, flags
            conflict, or ``--gait`` exceeds the number of ticks.
        InvalidRobot: a file contains no robot.
        SimulationDiverged: the physics diverged.
        ExperimentError: no such experiment, or it does not support a sensor.
    """
    allow(options.plugins)
    _check(options)
    shown = read_shown(options)
    if options.out.suffix.lower() in FILM_ENDINGS:
        _draw_film(options, shown, simulate)
    elif options.gait:
        _draw_gait(options, shown, simulate)
    else:
        with _film(options, shown, _starts(shown), 1.0) as film:
            save_picture(film[0], options.out)
    print(f"{options.out}: written")
    return 0


def _check(options: argparse.Namespace) -> None:
    """Refuse an ending, and flags that have no meaning for it."""
    out: Path = options.out
    ending = out.suffix.lower()
    if ending not in (PICTURE_ENDING, *FILM_ENDINGS):
        allowed = ", ".join((PICTURE_ENDING, *FILM_ENDINGS))
        raise NoPictures(f"{out}: must end in one of {allowed}, got {out.suffix!r}")
    is_film, is_clear = ending in FILM_ENDINGS, options.background == TRANSPARENT
    if is_film and (options.gait or is_clear):
        flag = "--gait" if options.gait else f"--background {TRANSPARENT}"
        raise NoPictures(f"{out}: {flag} needs a {PICTURE_ENDING} file")
    if options.gait and len(options.files) > 1:
        raise NoPictures("--gait: shows one robot, got several files")
    if not is_film and (options.seconds or options.trail):
        flag = "--seconds" if options.seconds else "--trail"
        raise NoPictures(f"{out}: {flag} needs a film: {', '.join(FILM_ENDINGS)}")


def read_shown(options: argparse.Namespace) -> Shown:
    """Return the robots of ``options.files``, files or run folders, by name.

    Raises:
        RevolveError: as of ``read_with_settings``.
        NoPictures: a file is given twice.
    """
    shown: Shown = {}
    for file in options.files:
        is_run = (file / BEST).is_file()
        robot, settings, _ = read_with_settings(
            file / BEST if is_run else file,
            options.experiment,
            options.island,
            tells_default=not shown,
        )
        name = file.resolve().name if is_run else file.stem
        shown[name if name not in shown else str(file)] = robot, settings
    if len(shown) < len(options.files):
        raise NoPictures("several robots: each file may be given once")
    uneven = [name for name, (_, own) in shown.items() if not own.environment.is_even]
    if len(shown) > 1 and uneven:
        tell_user(f"side by side, robots are drawn on a plane: {', '.join(uneven)}")
    return shown


def _film(
    options: argparse.Namespace,
    shown: Shown,
    poses: list[Floats],
    interval_s: float,
    advance: Callable[[], object] = lambda: None,
) -> Film:
    robots = {name: robot for name, (robot, _) in shown.items()}
    robot, settings = next(iter(shown.values()))
    is_moving = options.out.suffix.lower() in FILM_ENDINGS
    is_still = options.gait or len(shown) > 1
    is_clear = options.background == TRANSPARENT
    look = Look(
        size=options.size,
        camera=options.camera or ("fixed" if is_still else "follow"),
        background=None if is_clear else options.background,
        is_clear=is_clear,
        has_trail=options.trail,
        has_start=options.start_mark,
        has_scale=options.scale_bar,
    )
    return Film(
        robots if len(shown) > 1 else robot, settings, look, poses, interval_s,
        is_fine=not is_moving, advance=advance,
    )  # fmt: skip


def _starts(shown: Shown) -> list[Floats]:
    """Return the state of robots before their first step."""
    starts = []
    for robot, settings in shown.values():
        with RobotRenderer(robot, settings) as renderer:
            starts.append([renderer.stage.data.qpos.copy()])
    return side_by_side(starts, [*shown.values()]) if len(shown) > 1 else starts[0]


def _draw_film(options: argparse.Namespace, shown: Shown, simulate: Simulate) -> None:
    interval_s, motions = 1.0 / options.fps, []
    with bars(f"simulating and rendering {options.out}") as bar:
        for robot, settings in bar.track(shown.values(), description="simulating"):
            lasting = lasting_for(settings, options.seconds)
            motions.append(recorded(simulate, robot, lasting, interval_s))
        poses = motions[0]
        if len(shown) > 1:
            poses = side_by_side(motions, [*shown.values()])
        task = bar.add_task("rendering", total=len(poses))
        with _film(
            options, shown, poses, interval_s, advance=lambda: bar.advance(task)
        ) as film:
            save_film(film, options.out, interval_s)


def lasting_for(
    settings: EvaluationSettings, seconds: float | None
) -> EvaluationSettings:
    """Return settings of the first seconds of an evaluation, or of all of it."""
    clock = settings.simulation
    if seconds is not None:
        steps = max(1, steps_of(seconds, clock))
        clock = replace(clock, warmup_steps=0, window_steps=steps)
    return replace(settings, simulation=clock)


def _draw_gait(options: argparse.Namespace, shown: Shown, simulate: Simulate) -> None:
    """Write a strip of some ticks of an evaluation, by a camera that stands still."""
    ((robot, settings),) = shown.values()
    tick_s, count = settings.simulation.tick_s, options.gait
    ticks = -(-settings.simulation.evaluation_steps // settings.simulation.brain_steps)
    # From the middle on, when the first fall is over.
    first = ticks // 2
    if count > ticks - first:
        raise NoPictures(
            f"--gait {count}: must be <= {ticks - first}, the number of ticks in the "
            "second half of the evaluation"
        )
    with bars(f"simulating and rendering {options.out}") as bar:
        poses = recorded(simulate, robot, settings, tick_s)[first : first + count]
        task = bar.add_task("rendering", total=count)
        with _film(
            options, shown, poses, tick_s, advance=lambda: bar.advance(task)
        ) as film:
            texts = [f"{(first + at) * tick_s:.2f} s" for at in range(count)]
            save_picture(gait_strip(film[:], texts), options.out)
