"""Cost of a birth for the coordinator, and speed-up by a second worker."""

import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
from msgspec.structs import replace

import analyzer.service
import worker.serve.null
import worker.serve.service
from coordinator.dispatch.events import Joined, Left
from coordinator.dispatch.fleet import Fleet
from coordinator.dispatch.pool import AHEAD_S
from coordinator.evolution.generation import generate
from coordinator.islands.events import (
    Evaluate,
    Evaluated,
    IslandCommand,
    IslandEvent,
    JournalledEvent,
    Started,
)
from coordinator.islands.island import Island
from coordinator.islands.rows import evaluation_record
from coordinator.network.service import Network
from coordinator.run.loop import Loop
from coordinator.run.run_context import RunContext
from coordinator.storage.folder import RunDetails, RunFolder
from coordinator.storage.journal import Journal
from coordinator.storage.recorder import Recorder
from coordinator.storage.snapshots import Snapshots
from schema.agent.network import Agent
from schema.agent.supervision import ProcessSlot
from schema.agent.supervisor import ProcessPool, prepare_process
from schema.agent.topics import unique_name
from schema.experiment.document import Experiment, body_space
from schema.experiment.file import experiment_text, read_experiment
from schema.robot.genome import develop
from schema.robot.ids import BirthId
from schema.robot.robot import Robot

prepare_process()  # as the command does, before anybody opens a session

pytestmark = [pytest.mark.benchmark, pytest.mark.timeout(300)]

Body = Callable[[Agent, ProcessSlot], None]
CPU_PER_BIRTH_S = 1.5e-3
NULL_PER_S = 1000
SECOND_WORKER = 1.85
TURNS = 10
TURN_S = 2.0
JOINING_S = 0.3
LEAVING_S = AHEAD_S + 0.2  # what one that leaves had ahead is done by then


class Judged(Island):
    """Island that requests evaluations of ready-made robots; no mating."""

    def __init__(self, experiment: Experiment, robots: list[Robot]) -> None:
        super().__init__(experiment, 1, 0)
        self._robots = robots
        self._requested = 0
        self._births_wanted = experiment.births

    def handle(self, event: IslandEvent) -> list[IslandCommand]:
        commands: list[IslandCommand] = []
        if isinstance(event, Started):
            asked = 64
        else:
            assert isinstance(event, Evaluated)
            self.births += 1
            commands.append(evaluation_record(event))
            asked = 1
        for _ in range(min(asked, self._births_wanted - self._requested)):
            robot = self._robots[self._requested % len(self._robots)]
            commands.append(Evaluate(BirthId(0, self._requested), robot))
            self._requested += 1
        return commands


class Counted:
    """Journal that counts the evaluations that it stores.

    Births are committed in order, so their number rises in jumps; that of evaluations
    does not.
    """

    def __init__(self, journal: Journal) -> None:
        self.evaluations = 0
        self._journal = journal

    def append(self, events: Sequence[JournalledEvent]) -> None:
        self._journal.append(events)
        self.evaluations += sum(isinstance(event, Evaluated) for event in events)


@dataclass(frozen=True, slots=True)
class Figures:
    """Evaluations per second, and CPU time of this process for each [s]."""

    per_s: float
    cpu_s: float


@dataclass(frozen=True, slots=True)
class Bench:
    """Running run: its agents, its loop, and its number of evaluations."""

    fleet: Fleet
    loop: Loop
    journal: Counted

    def go_on(self, is_enough: Callable[[], bool]) -> Figures:
        """Step until a number of evaluations is reached; return their cost."""
        before = self.journal.evaluations
        wall_s, cpu_s = time.perf_counter(), time.process_time()
        while not is_enough():
            ends = self.fleet.listen(0.2, time.monotonic())
            self.loop.act(time.monotonic(), ends.get(self.loop.client, ()))
        wall_s = time.perf_counter() - wall_s
        cpu_s = time.process_time() - cpu_s
        done = self.journal.evaluations - before
        return Figures(done / wall_s, cpu_s / max(1, done))

    def go_on_for(self, seconds: float) -> Figures:
        """Step for a time; return the cost of its evaluations."""
        end_s = time.monotonic() + seconds
        return self.go_on(lambda: time.monotonic() >= end_s)


@contextmanager
def started(
    folder: Path, island: Island, experiment: Experiment, workers: int, body: Body
) -> Iterator[Bench]:
    """Yield a started run with all its workers connected."""
    details = RunDetails(experiment.name, 0, 1, experiment_text(experiment))
    with ExitStack() as stack:
        held = stack.enter_context(RunFolder(folder, details))
        recorder = Recorder(folder, details)
        stack.callback(recorder.close)
        network = stack.enter_context(Network(name=unique_name("bench")))
        vetters = Agent("analyzer", "analyzer", network.address)
        stack.enter_context(ProcessPool(analyzer.service.process, (vetters,), size=1))
        agent = Agent("worker", "worker", network.address)
        stack.enter_context(ProcessPool(body, (agent,), size=workers))
        journal = Counted(stack.enter_context(Journal.open(folder)))
        fleet = Fleet(network)
        loop = Loop(
            {0: island},
            context=RunContext.of(str(folder), held.epoch, experiment, details.origin),
            fleet=fleet,
            log=journal,
            rows=recorder,
            snapshot_store=Snapshots(folder),
        )
        loop.start([])
        bench = Bench(fleet, loop, journal)
        bench.go_on(
            lambda: (
                journal.evaluations >= 40 and fleet.dispatch.agents("worker") == workers
            )
        )
        yield bench


def whole(
    folder: Path, island: Island, experiment: Experiment, workers: int, body: Body
) -> Figures:
    """Run an island to its last evaluation."""
    with started(folder, island, experiment, workers, body) as bench:
        return bench.go_on(lambda: bench.journal.evaluations >= experiment.births)


def _experiment(births: int, brood: int) -> Experiment:
    shipped = read_experiment("scenario1")
    selection = replace(shipped.selection, children=brood)
    return replace(shipped, births=births, selection=selection)


def test_coordinator_cpu_per_birth(tmp_path: Path) -> None:
    experiment = _experiment(1500, 15)
    island = Island(experiment, 1, 0)
    found = whole(tmp_path / "run", island, experiment, 1, worker.serve.null.process)
    print(
        f"\nwhole births without physics: {found.per_s:.0f}/s, "
        f"coordinator {1e3 * found.cpu_s:.2f} ms CPU per birth"
    )
    assert found.cpu_s <= CPU_PER_BIRTH_S


def test_null_evaluations_per_second(tmp_path: Path) -> None:
    experiment = _experiment(6000, 15)
    space = body_space(experiment.space)
    robots = [
        develop(generate(np.random.default_rng(seed), experiment), space)
        for seed in range(50)
    ]
    island = Judged(experiment, robots)
    found = whole(tmp_path / "run", island, experiment, 1, worker.serve.null.process)
    print(
        f"\nnull evaluations, journal and tables on: {found.per_s:.0f}/s, "
        f"coordinator {1e3 * found.cpu_s:.2f} ms CPU each"
    )
    assert found.per_s >= NULL_PER_S


def test_second_worker(tmp_path: Path) -> None:
    """Evaluations per second of two workers against one, everything else included.

    Coordinator, analyzer, two workers, physics, network, journal and tables share the
    machine. Children of random founders of scenario 1 are bred, vetted and evaluated.
    Two things differ from a run of scenario 1: the brood does not end while it is
    measured, so no worker waits for the last child, and 60 births are in flight.

    One of two workers leaves and joins in turn, so that both halves of the comparison
    see the same drift of the machine's speed. A worker that leaves returns its queued
    jobs, so that the other worker gets them and births continue to be committed. It
    finishes the job that it has begun, and is idle before the next turn is counted.
    """
    experiment = _experiment(10_000, 9_000)
    wide = replace(experiment.selection, window=60)
    experiment = replace(experiment, selection=wide)
    island = Island(experiment, 1, 0)
    body = worker.serve.service.process
    rates: dict[int, list[float]] = {1: [], 2: []}
    cpu_s = []
    with started(tmp_path / "run", island, experiment, 2, body) as bench:
        name = bench.fleet.dispatch.names("worker")[1]
        platform = bench.fleet.dispatch.platform(name)
        for turn in range(2 * TURNS):
            workers = 1 + turn % 2
            joins = Joined(name, "worker", 1, platform)
            bench.fleet.tell(Left(name) if workers == 1 else joins)
            bench.go_on_for(LEAVING_S if workers == 1 else JOINING_S)
            found = bench.go_on_for(TURN_S)
            rates[workers].append(found.per_s)
            cpu_s.append(found.cpu_s)
    one, two = np.mean(rates[1]), np.mean(rates[2])
    print(
        f"\none worker {one:.1f}/s, two {two:.1f}/s: {two / one:.3f}; coordinator "
        f"{1e3 * np.median(cpu_s):.2f} ms CPU per birth"
    )
    assert two / one >= SECOND_WORKER
