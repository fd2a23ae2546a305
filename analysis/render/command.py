"""``revolve robot render``: pictures of robots in files."""

import argparse
from pathlib import Path

from msgspec.structs import replace

from analysis.progress import bars
from analysis.render.files import NoPictures, gait_strip, save_film, save_picture
from analysis.render.film import RobotFilm
from analysis.render.flags import FILM_ENDINGS, PICTURE_ENDING, TRANSPARENT
from analysis.render.motion import Shown, recorded, side_by_side
from analysis.render.picture import RobotRenderer, Simulate
from schema.agent.log import tell_user
from schema.experiment.document import steps_of
from schema.experiment.settings import EvaluationSettings
from schema.formats.run_settings import read_with_settings
from schema.plugins.permission import allow
from schema.robot.trace import Floats


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
    (_, settings), *others = shown.values()
    tick_s, first, last = settings.simulation.tick_s, 0, None
    if options.gait:
        first, last = _ticks_of_gait(options.gait, settings)
    is_film = options.out.suffix.lower() in FILM_ENDINGS
    interval_s = 1.0 / options.fps if is_film else tick_s
    with bars(f"rendering {options.out}") as bar:
        motions: list[list[Floats]] = []
        for robot, own in bar.track(shown.values(), description="simulating"):
            if is_film or options.gait:
                lasting = lasting_for(own, options.seconds)
                motions.append(recorded(simulate, robot, lasting, interval_s))
            else:
                with RobotRenderer(robot, own) as renderer:
                    motions.append([renderer.stage.data.qpos.copy()])
        poses = side_by_side(motions, shown) if others else motions[0][first:last]
        task = bar.add_task("rendering", total=len(poses))
        with RobotFilm(
            shown, poses, options, interval_s, is_fine=not is_film,
            advance=lambda: bar.advance(task),
        ) as film:  # fmt: skip
            if is_film:
                save_film(film, options.out, interval_s)
            elif options.gait:
                texts = [f"{(first + at) * tick_s:.2f} s" for at in range(len(film))]
                save_picture(gait_strip(list(film), texts), options.out)
            else:
                save_picture(film[0], options.out)
    print(f"{options.out}: written")
    return 0


def _ticks_of_gait(count: int, settings: EvaluationSettings) -> tuple[int, int]:
    """Return the range of ticks of a strip, after the first fall."""
    clock = settings.simulation
    ticks = -(-clock.evaluation_steps // clock.brain_steps)
    first = ticks // 2
    if count > ticks - first:
        raise NoPictures(
            f"--gait {count}: must be <= {ticks - first}, the number of ticks in the "
            "second half of the evaluation"
        )
    return first, first + count


def _check(options: argparse.Namespace) -> None:
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
        robot, settings, _ = read_with_settings(
            file, options.experiment, options.island, tells_default=not shown
        )
        name = file.resolve().name if file.is_dir() else file.stem
        shown[name if name not in shown else str(file)] = robot, settings
    if len(shown) < len(options.files):
        raise NoPictures("several robots: each file may be given once")
    uneven = [name for name, (_, own) in shown.items() if not own.environment.is_even]
    if len(shown) > 1 and uneven:
        tell_user(f"side by side, robots are drawn on a plane: {', '.join(uneven)}")
    return shown


def lasting_for(
    settings: EvaluationSettings, seconds: float | None
) -> EvaluationSettings:
    """Return settings of the first seconds of an evaluation, or of all of it."""
    clock = settings.simulation
    if seconds is not None:
        steps = max(1, steps_of(seconds, clock))
        clock = replace(clock, warmup_steps=0, window_steps=steps)
    return replace(settings, simulation=clock)
