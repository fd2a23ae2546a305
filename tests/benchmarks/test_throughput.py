"""What a birth costs the coordinator, and what a second worker brings."""

import time
from collections.abc import Callable, Iterable, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
from msgspec.structs import replace

import analyzer.service
import worker.null
import worker.service
from coordinator.events import (
    Evaluate,
    Evaluated,
    IslandCommand,
    IslandEvent,
    Journalled,
    Started,
)
from coordinator.folder import RunDetails, RunFolder
from coordinator.generation import generate
from coordinator.island import Island
from coordinator.journal import Journal
from coordinator.loop import Loop
from coordinator.questions import Question
from coordinator.record import Recorder
from coordinator.rows import evaluation_record
from coordinator.service import Network
from coordinator.snapshots import Snapshots
from schema.birth import BirthId
from schema.crew import Crew
from schema.experiment import (
    Experiment,
    body_space,
    evaluation_settings,
    experiment_text,
    read_experiment,
    vetting_settings,
)
from schema.genome import develop
from schema.network import Agent
from schema.robot import Robot
from schema.topics import unique_name

pytestmark = [pytest.mark.benchmark, pytest.mark.timeout(300)]

Body = Callable[[Agent, int], None]
CPU_PER_BIRTH_S = 1.5e-3
NULL_PER_S = 1000
SECOND_WORKER = 1.85


class Judged(Island):
    """Asks for evaluations of ready-made robots, so many at a time; no mating."""

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
    """A journal that counts the evaluations that it keeps.

    Births are committed in order and so come in leaps; evaluations do not.
    """

    def __init__(self, journal: Journal) -> None:
        self.evaluations = 0
        self._journal = journal

    def append(self, events: Sequence[Journalled]) -> None:
        self._journal.append(events)
        self.evaluations += sum(isinstance(event, Evaluated) for event in events)


@dataclass(frozen=True, slots=True)
class Figures:
    """Evaluations per second; CPU of this process for each, its network's too [s]."""

    per_s: float
    cpu_s: float


def run(
    folder: Path, island: Island, experiment: Experiment, workers: int, body: Body
) -> Figures:
    """Run an island to its end; count all but its first and last tenth."""
    details = RunDetails(experiment.name, 0, 1, experiment_text(experiment))
    with ExitStack() as stack:
        held = stack.enter_context(RunFolder(folder, details))
        recorder = Recorder(folder, details)
        stack.callback(recorder.close)
        network = stack.enter_context(Network(name=unique_name("bench")))
        crews: Iterable[tuple[str, int, Body]] = (
            ("analyzer", 1, analyzer.service.process),
            ("worker", workers, body),
        )
        for role, size, target in crews:
            agent = Agent(
                "analyzer" if role == "analyzer" else "worker", role, network.address
            )
            stack.enter_context(Crew(target, (agent,), size=size))
        journal = Counted(stack.enter_context(Journal.open(folder)))
        loop = Loop(
            {0: island},
            question=Question(
                str(folder),
                held.epoch,
                vetting_settings(experiment),
                evaluation_settings(experiment),
            ),
            agents=network,
            log=journal,
            rows=recorder,
            vault=Snapshots(folder),
        )
        loop.start([])
        while (
            journal.evaluations < experiment.births // 10
            or loop.dispatch.agents("worker") < workers
        ):
            loop.step(0.2, time.monotonic())
        before = journal.evaluations
        wall_s, cpu_s = time.perf_counter(), time.process_time()
        # The end, when workers run out of jobs one by one, is left out.
        while journal.evaluations < experiment.births * 9 // 10:
            loop.step(0.2, time.monotonic())
        done = journal.evaluations - before
        wall_s = time.perf_counter() - wall_s
        cpu_s = time.process_time() - cpu_s
        while not island.is_finished:
            loop.step(0.2, time.monotonic())
        recorder.finish()
    return Figures(done / wall_s, cpu_s / done)


def _experiment(births: int, brood: int) -> Experiment:
    shipped = read_experiment("scenario1")
    selection = replace(shipped.selection, children=brood)
    return replace(shipped, births=births, selection=selection)


def test_coordinator_cpu_per_birth(tmp_path: Path) -> None:
    experiment = _experiment(1500, 15)
    island = Island(experiment, 1, 0)
    found = run(tmp_path / "run", island, experiment, 1, worker.null.process)
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
    found = run(tmp_path / "run", island, experiment, 1, worker.null.process)
    print(
        f"\nnull evaluations, journal and tables on: {found.per_s:.0f}/s, "
        f"coordinator {1e3 * found.cpu_s:.2f} ms CPU each"
    )
    assert found.per_s >= NULL_PER_S


def test_second_worker(tmp_path: Path) -> None:
    """One and two workers in turn, three times, the same births each time."""
    ratios = []
    experiment = _experiment(250, 235)
    for turn in range(3):
        rates = [
            run(
                tmp_path / f"{turn}-{workers}",
                Island(experiment, 1, 0),
                experiment,
                workers,
                worker.service.process,
            ).per_s
            for workers in (1, 2)
        ]
        ratios.append(rates[1] / rates[0])
        print(f"\none worker {rates[0]:.1f}/s, two {rates[1]:.1f}/s: {ratios[-1]:.3f}")
    assert np.median(ratios) >= SECOND_WORKER
