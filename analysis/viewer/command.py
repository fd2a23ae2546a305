"""``revolve view``: show a live run, or replay one from its tables."""

import argparse
from pathlib import Path

from analysis.measures.load import LoadedRun
from analysis.progress import bars
from analysis.viewer.blueprint import layout
from analysis.viewer.body import box_model
from analysis.viewer.entities import recording_name
from analysis.viewer.flags import LAST_S
from analysis.viewer.live import LiveSource
from analysis.viewer.motion import Motion, named_robot, selected_robots, show_motion
from analysis.viewer.output import Output, Window, keep_serving
from analysis.viewer.recording import Recording, ViewerError
from analysis.viewer.replay import CHUNK_S, read_past, read_poses, span_of
from analysis.viewer.resimulate import Simulators, resimulate
from analysis.viewer.scene import scene_of
from analysis.viewer.show import Show
from analysis.viewer.watch import watch
from schema.agent.command import connect_of, tls_of
from schema.agent.log import tell_user
from schema.agent.supervisor import stop_on_signals
from schema.plugins.permission import allow
from schema.robot.ids import BirthId
from schema.robot.robot import Robot
from schema.tables.description import allow_plugins_of


def view(options: argparse.Namespace, simulators: Simulators) -> int:
    """Show a run in the viewer; return the exit code.

    Raises:
        RunFolderError: the folder has no run, or the run has no robot yet.
        NetworkError: no coordinator answers.
        ViewerError: the viewer cannot be opened, or the flags conflict.
    """
    allow(options.plugins)
    if options.run is not None and options.connect is not None:
        raise ViewerError("give either a run folder or --connect ADDRESS")
    if options.ancestry and not options.robot:
        raise ViewerError("--ancestry: needs --robot best, best-ever or ISLAND:BIRTH")
    if options.run is not None:
        output = Output.of(options.save, options.serve)
        _replay(options, output, simulators)
        return 0
    if options.robot or (options.start, options.until) != (None, None):
        raise ViewerError("--robot, --from and --until: for a run folder only")
    if options.connect is not None:
        # The folder of an active run; of an address nothing is known.
        allow_plugins_of(Path(options.connect))
    output = Output.of(options.save, options.serve)
    stop = stop_on_signals()
    with LiveSource(connect_of(options), options.fleet, tls_of(options)) as source:
        watch(source, output, options.follow, stop)
    return 0


def _replay(
    options: argparse.Namespace, output: Output, simulators: Simulators
) -> None:
    folder: Path = options.run
    run, experiment, news = read_past(folder)
    scene = scene_of(experiment)
    born = {one.birth for one in news.births}
    _check(options, born, is_online=bool(scene.arenas))
    motions = _motions(options, run, simulators)
    moving = [each.birth for each in motions]
    for line in scene.omissions(moving):
        tell_user(line)
    blueprint = layout(scene, follow=options.follow, motions=moving)
    name = recording_name(news.experiment, folder.resolve().name)
    with Recording(name, blueprint, file=output.file, serve=output.serve) as recording:
        recording.add_scene(scene)
        show = Show(recording, scene.space, scene.grid)
        span = None
        if scene.arenas:
            span = span_of(options, LAST_S, ViewerError)
            if span[0] > 0.0:
                tell_user(
                    f"showing poses from {span[0]:g} s to {span[1]:g} s; use --from "
                    "and --until for others"
                )
        with bars(f"recording {name}") as bar:
            task = bar.add_task("births", total=None)
            show.tell(news)
            bar.remove_task(task)
            if span is not None:
                chunks = (span[1] - span[0]) / CHUNK_S
                pieces = read_poses(folder, *span)
                shown = bar.track(pieces, chunks, description="recording poses")
                for arena, poses in shown:
                    show.move(arena, poses)
        bodies = {one.birth: one.body for one in news.births}
        recording.upright("motion")
        recording.ground("motion", scene.below(moving))
        for lane, motion in enumerate(motions):
            body = bodies[motion.birth]
            assert body is not None
            drawn = box_model(Robot(body), scene.space, is_plain=False)
            is_there = motion.birth.island in scene.arenas
            show_motion(recording, motion, drawn, None if is_there else lane)
        stop = stop_on_signals()
        keep_serving(output, Window(output), recording, stop)


def _check(options: argparse.Namespace, born: set[BirthId], *, is_online: bool) -> None:
    if not is_online and (options.start, options.until) != (None, None):
        raise ViewerError("--from and --until: this run has no arena and no poses")
    if options.follow and options.follow not in born:
        name = options.follow.name
        raise ViewerError(f"--follow {name}: no robot of that name was born")


def _motions(
    options: argparse.Namespace, run: LoadedRun, simulators: Simulators
) -> list[Motion]:
    """Return the motion of the robots of ``--robot``; print if it is as recorded."""
    wanted: list[BirthId] = []
    for robot in options.robot:
        if isinstance(robot, BirthId):
            wanted.append(robot)
        else:
            birth, line = named_robot(run.folder, robot)
            wanted.append(birth)
            tell_user(line)
    births = selected_robots(run.folder, wanted, has_ancestry=options.ancestry)
    if not births:
        return []
    with bars(f"re-simulating robots: {len(births)}") as bar:
        task = bar.add_task("re-simulating", total=1.0)
        motions = resimulate(
            run, births, simulators, lambda share: bar.update(task, completed=share)
        )
    for motion in motions:
        tell_user(motion.verdict)
    return motions
