"""Benchmarks of the CPU time per birth and of the gain of a second worker."""

import os
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
from msgspec.structs import replace

import analyzer.service
import tests.null_workers
import worker.serve.service
from coordinator.dispatch.events import Joined, Left
from coordinator.dispatch.fleet import JobRouter
from coordinator.dispatch.pool import AHEAD_S
from coordinator.evolution.generation import generate
from coordinator.islands.events import (
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
from schema.tables.arrow import skip_pandas
from schema.wire.messages import Evaluate

# As the command does, before the first session is opened.
prepare_process()
skip_pandas()

pytestmark = [pytest.mark.benchmark, pytest.mark.timeout(300)]

Body = Callable[[Agent, ProcessSlot], None]
CPU_PER_BIRTH_S = 1.5e-3
VETTING_PER_BIRTH_S = 0.8e-3
NULL_PER_S = 1000
SECOND_WORKER = 1.85
TURNS = 10
TURN_S = 2.0
JOINING_S = 0.3
LEAVING_S = AHEAD_S + 0.2  # time to finish the jobs that a leaving worker has


class EvaluationIsland(Island):
    """Island that requests evaluations of given robots, without mating."""

    def __init__(self, experiment: Experiment, robots: list[Robot]) -> None:
        super().__init__(experiment, 1, 0)
        self._robots = robots
        self._requested = 0
        self._births_wanted = experiment.births

    def handle(self, event: IslandEvent) -> list[IslandCommand]:
        commands: list[IslandCommand] = []
        if isinstance(event, Started):
            requests = 64
        else:
            assert isinstance(event, Evaluated)
            self.births += 1
            commands.append(evaluation_record(event))
            requests = 1
        for _ in range(min(requests, self._births_wanted - self._requested)):
            robot = self._robots[self._requested % len(self._robots)]
            commands.append(Evaluate(BirthId(0, self._requested), robot))
            self._requested += 1
        return commands


class CountingJournal:
    """Journal that counts evaluations.

    Births are committed in order and therefore in bursts; evaluations are not.
    """

    def __init__(self, journal: Journal) -> None:
        self.evaluations = 0
        self._journal = journal

    def append(self, events: Sequence[JournalledEvent]) -> None:
        self._journal.append(events)
        self.evaluations += sum(isinstance(event, Evaluated) for event in events)


@dataclass(frozen=True, slots=True)
class Figures:
    """Evaluations per second; CPU time per evaluation [s], including the network.

    ``cpu_s`` is that of the coordinator, ``vetting_s`` that of the analyzer's process.
    """

    per_s: float
    cpu_s: float
    vetting_s: float


def cpu_time_s(pid: int) -> float:
    """Return the CPU time of a process, system time included [s]."""
    fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


@dataclass(frozen=True, slots=True)
class Bench:
    """Running experiment: its fleet, its loop, its journal, its analyzer's process."""

    fleet: JobRouter
    loop: Loop
    journal: CountingJournal
    analyzer: int

    def measure(self, is_done: Callable[[], bool]) -> Figures:
        """Step until a condition holds; return rate and CPU time."""
        before = self.journal.evaluations
        wall_s, cpu_s = time.perf_counter(), time.process_time()
        vetting_s = cpu_time_s(self.analyzer)
        while not is_done():
            ends = self.fleet.listen(0.2, time.monotonic())
            self.loop.act(time.monotonic(), ends.get(self.loop.client, ()))
        wall_s = time.perf_counter() - wall_s
        cpu_s = time.process_time() - cpu_s
        vetting_s = cpu_time_s(self.analyzer) - vetting_s
        done = self.journal.evaluations - before
        each = 1.0 / max(1, done)
        return Figures(done / wall_s, cpu_s * each, vetting_s * each)

    def measure_for(self, seconds: float) -> Figures:
        """Step for a duration [s]; return rate and CPU time."""
        end_s = time.monotonic() + seconds
        return self.measure(lambda: time.monotonic() >= end_s)


@contextmanager
def started(
    folder: Path, island: Island, experiment: Experiment, workers: int, body: Body
) -> Iterator[Bench]:
    """Start a run and yield it once all its workers are connected."""
    details = RunDetails(experiment.name, 0, 1, experiment_text(experiment))
    with ExitStack() as stack:
        held = stack.enter_context(RunFolder(folder, details))
        recorder = Recorder(folder, details)
        stack.callback(recorder.close)
        network = stack.enter_context(Network(name=unique_name("bench")))
        vetters = Agent("analyzer", "analyzer", network.address)
        pool = ProcessPool(analyzer.service.process, (vetters,), size=1)
        stack.enter_context(pool)
        agent = Agent("worker", "worker", network.address)
        stack.enter_context(ProcessPool(body, (agent,), size=workers))
        journal = CountingJournal(stack.enter_context(Journal.open(folder)))
        fleet = JobRouter(network)
        loop = Loop(
            {0: island},
            context=RunContext.of(str(folder), held.epoch, experiment, details.origin),
            fleet=fleet,
            log=journal,
            rows=recorder,
            snapshot_store=Snapshots(folder),
        )
        loop.start([])
        bench = Bench(fleet, loop, journal, pool.pids[0])
        bench.measure(
            lambda: (
                journal.evaluations >= 40 and fleet.dispatch.agents("worker") == workers
            )
        )
        yield bench


def measure_run(
    folder: Path, island: Island, experiment: Experiment, workers: int, body: Body
) -> Figures:
    """Measure a run of an island to its last evaluation."""
    with started(folder, island, experiment, workers, body) as bench:
        return bench.measure(lambda: bench.journal.evaluations >= experiment.births)


def _experiment(births: int, brood: int) -> Experiment:
    shipped = read_experiment("scenario1")
    selection = replace(shipped.selection, children=brood)
    return replace(shipped, births=births, selection=selection)


@pytest.mark.parametrize("parts", [12.0, 25.0], ids=["founders", "evolved"])
def test_cpu_per_birth(tmp_path: Path, parts: float) -> None:
    """Founders of scenario 1 have 12 parts on average, its evolved robots 25.

    Without physics nothing evolves, so founders of the second size are generated.
    """
    experiment = _experiment(1500, 15)
    generation = replace(experiment.generation, parts_mean=parts)
    experiment = replace(experiment, generation=generation)
    island = Island(experiment, 1, 0)
    found = measure_run(
        tmp_path / "run", island, experiment, 1, tests.null_workers.process
    )
    print(
        f"\nwhole births without physics: {found.per_s:.0f}/s, "
        f"coordinator {1e3 * found.cpu_s:.2f} ms CPU per birth, "
        f"analyzer {1e3 * found.vetting_s:.2f} ms"
    )
    assert found.cpu_s <= CPU_PER_BIRTH_S
    assert found.vetting_s <= VETTING_PER_BIRTH_S


def test_null_evaluations_per_second(tmp_path: Path) -> None:
    experiment = _experiment(6000, 15)
    space = body_space(experiment.space)
    robots = [
        develop(generate(np.random.default_rng(seed), experiment), space)
        for seed in range(50)
    ]
    island = EvaluationIsland(experiment, robots)
    found = measure_run(
        tmp_path / "run", island, experiment, 1, tests.null_workers.process
    )
    print(
        f"\nnull evaluations, journal and tables on: {found.per_s:.0f}/s, "
        f"coordinator {1e3 * found.cpu_s:.2f} ms CPU each"
    )
    assert found.per_s >= NULL_PER_S


def test_gain_of_a_second_worker(tmp_path: Path) -> None:
    """Compare the evaluations per second of two workers with those of one.

    Coordinator, analyzer, two workers, real physics, network, journal and tables
    share the machine. Children of random founders are bred, vetted and evaluated as
    in scenario 1, with two differences: the brood does not end during the
    measurement, so no worker waits for its last child, and 60 births are in flight.
    One of the two workers leaves and joins in alternate turns, so that changes of the
    machine's speed affect both settings equally. The jobs of a leaving worker go to
    the other one, so births are still committed and each setting includes the
    breeding and vetting of its own births. The leaving worker finishes its current
    jobs and is idle before the turn is measured.
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
            bench.measure_for(LEAVING_S if workers == 1 else JOINING_S)
            found = bench.measure_for(TURN_S)
            rates[workers].append(found.per_s)
            cpu_s.append(found.cpu_s)
    one, two = np.mean(rates[1]), np.mean(rates[2])
    gains = np.divide(rates[2], rates[1])
    error = gains.std(ddof=1) / np.sqrt(TURNS)
    print(
        f"\none worker {one:.1f}/s, two {two:.1f}/s: {two / one:.3f} +- {error:.3f}; "
        f"coordinator {1e3 * np.median(cpu_s):.2f} ms CPU per birth"
    )
    assert two / one >= SECOND_WORKER
