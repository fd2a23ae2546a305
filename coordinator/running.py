"""One run from its first birth to its last, or to the next resume."""

import json
import math
import socket
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from datetime import UTC, datetime
from importlib import metadata
from pathlib import Path
from threading import Event

from coordinator.arena import Arena
from coordinator.audience import Audience
from coordinator.disk import replace_durably
from coordinator.events import AgentKind, Record
from coordinator.fleet import Agents, Fleet
from coordinator.folder import DETAILS, RunDetails, RunFolder, read_state
from coordinator.island import Island
from coordinator.journal import Journal
from coordinator.live import Feed, Overheard
from coordinator.local import LocalAgents
from coordinator.loop import Loop
from coordinator.operator import Desk
from coordinator.pacing import Pace
from coordinator.progress import Display
from coordinator.questions import Question
from coordinator.record import Recorder
from coordinator.service import Network
from coordinator.snapshots import Snapshots
from coordinator.summary import tell_result
from schema.crew import Crew, stop_on_signals
from schema.experiment import Experiment
from schema.experiment_file import experiment_from_text, experiment_text
from schema.network import THIS_MACHINE, Agent, Tls
from schema.platform_tag import cpu_flags, our_version, platform_tag
from schema.service import tell_user
from schema.settings import arena_settings, evaluation_settings, vetting_settings
from schema.topics import unique_name

ADDRESS = "address"
"""File of a run folder that says where its coordinator listens, while it does."""

_LOOK_S = 0.2
_CHORES_S = 1.0
_LIBRARIES = ("mujoco-core", "eclipse-zenoh", "numpy", "pyarrow", "protobuf")


@dataclass(frozen=True, slots=True)
class Deployment:
    """Where and by whom a run is done; none of it changes a birth.

    Attributes:
        workers: worker processes to start here; an analyzer comes with them.
        bodies: what a process of each kind runs (agent, index).
        answers: functions in place of processes and network, or None.
        listen: address of the hub; any free port of this machine if None.
        fleet: whose agents to use.
        tls: files for a ``tls/`` address.
        quiet: show nothing but the end.
        fsync: survive power loss, too.
        threads: that advance one arena together in a process here.
        speed: simulated seconds per second at most, of arenas; None: no limit.
    """

    workers: int
    bodies: Mapping[AgentKind, Callable[[Agent, int], None]]
    answers: Mapping[AgentKind, Callable[[bytes], bytes]] | None
    listen: str | None
    fleet: str
    tls: Tls | None
    quiet: bool
    fsync: bool
    threads: int = 1
    speed: float | None = None


def start(
    folder: Path, experiment: Experiment, seed: int, deployment: Deployment
) -> int:
    """Run an experiment in a new folder; return the exit code.

    Raises:
        RunFolderError: the folder is used or held, or the disk fails.
        NetworkError: the address cannot be listened on.
        ExperimentError: no robot meets its restrictions.
    """
    details = RunDetails(experiment.name, 0, seed, experiment_text(experiment))
    return _run(folder, details, deployment)


def resume(folder: Path, deployment: Deployment) -> int:
    """Go on with the run of a folder; return the exit code.

    Raises:
        RunFolderError: no run is there, it is held by another coordinator, its
            journal is damaged, or the disk fails.
        NetworkError: the address cannot be listened on.
    """
    if read_state(folder) == "finished":
        tell_user(f"{folder}: is finished; nothing is left to do")
        return 0
    return _run(folder, None, deployment)


def _run(folder: Path, details: RunDetails | None, deployment: Deployment) -> int:
    stop = stop_on_signals()
    with ExitStack() as stack:
        held = stack.enter_context(RunFolder(folder, details))
        journal = stack.enter_context(Journal.open(folder, fsync=deployment.fsync))
        if journal.dropped:
            tell_user(
                f"journal: dropped a cut record of {journal.dropped} bytes at its end"
            )
        recorder = Recorder(folder, held.details, fsync=deployment.fsync)
        stack.callback(recorder.close)
        experiment = experiment_from_text(held.details.document)
        agents, crews = stack.enter_context(_agents(held, deployment))
        machine = Arena if experiment.arena else Island
        fleet = Fleet(agents)
        question = _question(held, experiment)
        feed = Feed(question.run, held.epoch, held.details)
        loop = Loop(
            {0: machine(experiment, held.details.seed, held.details.run)},
            question=question,
            fleet=fleet,
            log=journal,
            rows=Overheard(recorder, feed),
            vault=Snapshots(folder),
            pace=_pace(experiment, deployment),
        )
        loop.start(journal.replay())
        held.set_state("running")
        serve = _servant(Desk(loop, experiment), feed, loop, fleet, agents)
        quiet = deployment.quiet
        with Display(loop, fleet.dispatch, experiment, quiet=quiet) as display:
            chores = [recorder.flush, held.confirm, *crews]
            _turn(loop, fleet, display, stop, chores, serve)
        if not loop.is_finished:
            recorder.flush()
            held.set_state("stopped")
            tell_user(f"stopped; to go on: revolve resume {folder}")
            return 130
        held.confirm()
        recorder.write(_runs_row(held))
        recorder.finish()
        held.set_state("finished")
    tell_result(folder, experiment, loop.islands[0])
    return 0


def _question(held: RunFolder, experiment: Experiment) -> Question:
    """Return what all requests of a run have in common."""
    return Question(
        run=f"{socket.gethostname()}:{held.path.resolve()}",
        epoch=held.epoch,
        vetting=vetting_settings(experiment),
        evaluation=evaluation_settings(experiment),
        arena=arena_settings(experiment) if experiment.arena else b"",
    )


def _pace(experiment: Experiment, deployment: Deployment) -> Pace | None:
    """Return what holds arenas back, None if nothing shall."""
    if deployment.speed is None:
        return None
    return Pace(deployment.speed, experiment.simulation.timestep_s)


def _servant(
    desk: Desk, feed: Feed, loop: Loop, fleet: Fleet, agents: Agents
) -> Callable[[], None]:
    """Return what serves operators and viewers; a run without a network has none."""
    if not isinstance(agents, Network):
        return lambda: None
    audience = Audience(feed, loop, fleet, agents)

    def serve() -> None:
        for order in agents.orders():
            order.reply(desk.answer(order.data))
        audience.serve(time.monotonic())

    return serve


def _turn(
    loop: Loop,
    fleet: Fleet,
    display: Display,
    stop: Event,
    chores: list[Callable[[], None]],
    serve: Callable[[], None],
) -> None:
    """Step until all is done or somebody says stop; do the chores once a second."""
    shown_s = done_s = -math.inf
    while not (loop.is_finished or stop.is_set()):
        now_s = time.monotonic()
        fleet.listen(min(_LOOK_S, max(0.0, loop.wake_s - now_s)), now_s)
        loop.act(time.monotonic())
        serve()
        now_s = time.monotonic()
        if now_s - shown_s >= _LOOK_S:
            shown_s = now_s
            display.update()
        if now_s - done_s >= _CHORES_S:
            done_s = now_s
            for chore in chores:
                chore()


@contextmanager
def _agents(
    held: RunFolder, deployment: Deployment
) -> Iterator[tuple[Agents, list[Callable[[], None]]]]:
    """Give whoever does the work, and what looks after them from time to time."""
    if deployment.answers is not None:
        yield LocalAgents(deployment.answers, platform_tag()), []
        return
    with ExitStack() as stack:
        network = stack.enter_context(
            Network(
                name=unique_name("coordinator"),
                fleet=deployment.fleet,
                listen=(deployment.listen or THIS_MACHINE,),
                tls=deployment.tls,
            )
        )
        note = held.path / ADDRESS
        # Whoever waits for the file shall find the address in it.
        text = f"{network.address}\n"
        replace_durably(note, lambda file: file.write_text(text, encoding="utf-8"))
        stack.callback(note.unlink, missing_ok=True)
        crews: list[Callable[[], None]] = []
        sizes: dict[AgentKind, int] = {"analyzer": 1, "worker": deployment.workers}
        for kind, size in sizes.items() if deployment.workers else ():
            agent = Agent(
                kind, f"own-{kind}", network.address, deployment.fleet,
                tls=deployment.tls, threads=deployment.threads,
            )  # fmt: skip
            crew = Crew(deployment.bodies[kind], (agent,), size=size)
            crews.append(stack.enter_context(crew).look_after)
        if deployment.listen is not None:
            tell_user(f"listening on {network.address}")
        yield network, crews


def _runs_row(held: RunFolder) -> Record:
    """Return the one row of the runs table."""
    details = held.details
    began = (held.path / DETAILS).stat().st_mtime
    versions = {name: metadata.version(name) for name in _LIBRARIES}
    versions["revolve-islands"] = our_version()
    row = {
        "name": details.name,
        "run": details.run,
        "seed": details.seed,
        "document": details.document,
        "state": "finished",
        "versions": json.dumps(versions),
        "platform": platform_tag(),
        "cpu_flags": " ".join(sorted(cpu_flags(Path("/proc/cpuinfo")))),
        "start": datetime.fromtimestamp(began, UTC),
        "end": datetime.now(UTC),
    }
    return Record("runs", row)
