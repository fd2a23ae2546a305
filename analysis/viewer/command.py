"""``revolve view``: watch a run while it lives, or again from its tables."""

import argparse
import re
from pathlib import Path

from rich.progress import Progress

from analysis.progress import bars
from analysis.viewer.blueprint import layout
from analysis.viewer.body import box_model
from analysis.viewer.live import LiveSource
from analysis.viewer.motion import Motion, best_evaluated, chosen, name_of, show_motion
from analysis.viewer.output import HOST, PORT, Output, Window, keep_serving
from analysis.viewer.recording import Recording, ViewerError
from analysis.viewer.replay import (
    CHUNK_S,
    Span,
    last_time,
    read_experiment,
    read_news,
    read_poses,
)
from analysis.viewer.resimulate import Simulators, resimulate
from analysis.viewer.scene import scene_of
from analysis.viewer.show import Show
from analysis.viewer.watch import watch
from schema.agent.command import add_network_flags, tls_of
from schema.agent.service import tell_user
from schema.agent.supervisor import stop_on_signals
from schema.flags import Flags, number
from schema.robot.ids import BirthId
from schema.wire.codec import decode_body

LAST_S = 600.0
"""Simulated time that is replayed unless told otherwise: the last so much [s]."""


def main(arguments: list[str], simulators: Simulators) -> int:
    """Watch a run.

    Args:
        arguments: the command's name first.
        simulators: do again what robots did.

    Returns:
        0 if done.

    Raises:
        RunFolderError: no run, or nobody born in it.
        NetworkError: no coordinator is there.
        ViewerError: the viewer cannot be opened, or flags that do not go together.
    """
    options = _flags().parse_args(arguments[1:])
    output = Output.of(options.save, options.serve)
    if (options.run is None) == (options.connect is None):
        raise ViewerError("name a run folder, or a coordinator by --connect: one")
    if options.ancestry and not options.robot:
        raise ViewerError("--ancestry: of whom? --robot best, or --robot ISLAND:BIRTH")
    if options.run is not None:
        _replay(options, output, simulators)
        return 0
    if options.robot or (options.start, options.until) != (None, None):
        raise ViewerError("--robot, --from and --until: of a run's folder only")
    stop = stop_on_signals()
    with LiveSource(options.connect, options.fleet, tls_of(options)) as source:
        watch(source, output, options.follow, stop)
    return 0


def _replay(
    options: argparse.Namespace, output: Output, simulators: Simulators
) -> None:
    """Record a run from its tables, then keep it there for who looks."""
    folder: Path = options.run
    scene = scene_of(read_experiment(folder))
    news = read_news(folder)
    born = {one.birth for one in news.births}
    _check(options, born, is_online=bool(scene.arenas))
    motions = _motions(options, simulators)
    moving = [each.birth for each in motions]
    blueprint = layout(
        scene.islands,
        extent_m=scene.extent_m,
        arenas=scene.arenas,
        follow=options.follow,
        motions=moving,
    )
    name = f"{news.experiment}-{folder.name}"
    with Recording(name, blueprint, file=output.file, serve=output.serve) as recording:
        recording.add_scene(scene)
        show = Show(recording, scene.space)
        span = _span(options, folder) if scene.arenas else None
        with bars(f"recording {name}") as bar:
            task = bar.add_task("births", total=None)
            show.tell(news)
            bar.remove_task(task)
            if span is not None:
                _replay_poses(folder, span, show, bar)
        bodies = {one.birth: one.body for one in news.births}
        recording.upright("motion")
        recording.ground("motion", scene.below(moving))
        for lane, motion in enumerate(motions):
            body = bodies[motion.birth]
            assert body is not None
            drawn = box_model(decode_body(body), scene.space, is_plain=False)
            is_there = motion.birth.island in scene.arenas
            show_motion(recording, motion, drawn, None if is_there else lane)
        stop = stop_on_signals()
        keep_serving(output, Window(output), recording, stop)


def _check(options: argparse.Namespace, born: set[BirthId], *, is_online: bool) -> None:
    """Refuse flags that this run gives nothing for."""
    if not is_online and (options.start, options.until) != (None, None):
        raise ViewerError("--from and --until: this run has no arena, and no poses")
    if options.follow and options.follow[1] not in born:
        birth = options.follow[1]
        raise ViewerError(f"--follow {name_of(birth)}: nobody of that name was born")


def _motions(options: argparse.Namespace, simulators: Simulators) -> list[Motion]:
    """Return the motion of the robots that were asked for; tell if it is equal."""
    folder: Path = options.run
    births = chosen(folder, _wanted(options), has_ancestry=options.ancestry)
    if not births:
        return []
    with bars(f"robots simulated again: {len(births)}") as bar:
        task = bar.add_task("simulating again", total=1.0)
        motions = resimulate(
            folder,
            read_experiment(folder),
            births,
            simulators,
            lambda share: bar.update(task, completed=share),
        )
    for motion in motions:
        tell_user(motion.verdict)
    return motions


def _wanted(options: argparse.Namespace) -> list[BirthId]:
    """Return the robots that were asked for by name; tell who the best is."""
    if None not in options.robot:
        return list(options.robot)
    best, fitness = best_evaluated(options.run)
    tell_user(f"best ever judged: {name_of(best)}, fitness {fitness:.4f}")
    return [best if who is None else who for who in options.robot]


def _span(options: argparse.Namespace, folder: Path) -> Span:
    """Return the simulated time to show; say so if it is not all there is."""
    end_s = last_time(folder) if options.until is None else options.until
    start_s = max(0.0, end_s - LAST_S) if options.start is None else options.start
    if start_s >= end_s:
        raise ViewerError(f"--from {start_s:g}: must be before {end_s:g} s")
    if start_s > 0.0:
        tell_user(
            f"poses from {start_s:g} s to {end_s:g} s; --from and --until show others"
        )
    return Span(start_s, end_s)


def _replay_poses(folder: Path, span: Span, show: Show, bar: Progress) -> None:
    bits = (span.end_s - span.start_s) / CHUNK_S
    for arena, poses in bar.track(read_poses(folder, span), bits, description="poses"):
        show.move(arena, poses)


def robot_name(text: str) -> BirthId:
    """Return the individual of a flag, as ``0:17``.

    Raises:
        argparse.ArgumentTypeError: another text.
    """
    match = re.fullmatch(r"(\d+):(\d+)", text)
    if match is None:
        raise argparse.ArgumentTypeError(f"must be ISLAND:BIRTH, as 0:17, got {text!r}")
    return BirthId(int(match[1]), int(match[2]))


def _chosen(text: str) -> BirthId | None:
    """Return whom a flag names; None is the best ever judged."""
    return None if text == "best" else robot_name(text)


def _followed(text: str) -> tuple[int, BirthId]:
    birth = robot_name(text)
    return birth.island, birth


def _flags() -> Flags:
    flags = Flags(
        prog="revolve view",
        description="Watch a run while it lives, or again from its tables.",
        epilog="for example: revolve view runs/scenario3-seed1 --save run.rrd",
        allow_abbrev=False,
    )
    flags.add_argument("run", nargs="?", type=Path, help="folder of a run to see again")
    flags.add_argument(
        "--connect", metavar="ADDRESS",
        help="the coordinator of a run to watch, as in the run folder's file 'address'",
    )  # fmt: skip
    flags.add_argument(
        "--save", type=Path, metavar="FILE", help="write a recording (.rrd), no window"
    )
    flags.add_argument(
        "--serve", nargs="?", const=f"{HOST}:{PORT}", metavar="HOST:PORT",
        help=f"let viewers connect, no window; default: {HOST}:{PORT}",
    )  # fmt: skip
    flags.add_argument(
        "--follow", type=_followed, metavar="ISLAND:BIRTH",
        help="have the camera follow a robot, as 0:17",
    )  # fmt: skip
    flags.add_argument(
        "--robot", action="append", default=[], type=_chosen, metavar="WHO",
        help="simulate a robot again to see all of its motion: best (ever judged, "
        "alive at the end or not), or ISLAND:BIRTH; may be given more than once",
    )  # fmt: skip
    flags.add_argument(
        "--ancestry", action="store_true",
        help="and its first parent, and so on, back to the founder",
    )  # fmt: skip
    flags.add_argument(
        "--from", dest="start", type=number, metavar="S",
        help=f"poses of a replay from there on [s]; default: the last {LAST_S:g} s",
    )  # fmt: skip
    flags.add_argument("--until", type=number, metavar="S", help="and to there [s]")
    add_network_flags(flags)
    return flags
