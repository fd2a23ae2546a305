"""Archipelago in one process, with answers in any order."""

from collections import deque
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from coordinator.arena.arena import Arena
from coordinator.islands.events import (
    ArenaCommand,
    Ask,
    Emigrate,
    Evaluated,
    Finish,
    IslandCommand,
    MigrationEvent,
    NeighbourClosed,
    Record,
    Started,
    arrival,
)
from coordinator.islands.island import Island
from coordinator.islands.outbox import Outbox
from coordinator.run.archipelago import archipelago
from coordinator.run.learners import Learners
from schema.experiment.check import check_experiment
from schema.experiment.document import (
    ArenaSection,
    Experiment,
    Islands,
    SelectionSection,
    Simulation,
    island_experiment,
)
from schema.experiment.identity import WHOLE, Group, Origin
from schema.experiment.migration import Migration
from schema.robot.ids import BirthId
from schema.robot.results import Evaluation
from schema.tables.description import KeptFounder
from schema.wire.arena import AdvanceShard
from schema.wire.messages import Breed, Evaluate
from tests.coordinator.arena_world import World, distinct_fitness
from tests.coordinator.breeding import WhyNot, bred, viable
from tests.coordinator.reports import PROVENANCE

Fit = Callable[[BirthId, int], float]


def distinct_on_islands(birth: BirthId, island: int) -> float:
    """Return a fitness in (0, 1) that differs between births and between islands."""
    return (birth.number * 0.618034 + birth.island * 0.31 + island * 0.07 + 0.1) % 1.0


def drawn_measures(birth: BirthId, count: int) -> tuple[float, ...]:
    """Return measures in [0, 1) that differ between births."""
    drawn = np.random.default_rng([birth.number, birth.island]).random(count)
    return tuple(drawn.tolist())


FEW = SelectionSection(population=5, tournament_size=2)
ARENA = Islands(
    simulation=Simulation(warmup_steps=600),
    arena=ArenaSection(population_limit=12, population_floor=4),
)
"""Five founders in the first 4 s, then a birth every 15 s.

Robots mature 15 s after they were dropped.
"""


@dataclass
class ArchipelagoRun:
    """An archipelago, or a group of its islands, and all commands of these.

    Attributes:
        order: how far to rotate the open requests before each answer.
        fit: fitness off-line, of a birth on an island.
        slow: islands whose requests are answered only if no other island has one.
    """

    experiment: Experiment
    seed: int = 1
    run: int = 0
    order: Iterator[int] | None = None
    fit: Fit = distinct_on_islands
    verdict: WhyNot = viable
    slow: tuple[int, ...] = ()
    founders: Mapping[str, KeptFounder] | None = None
    group: Group = WHOLE
    outbox: Outbox = field(default_factory=Outbox)
    islands: dict[int, Island | Arena] = field(default_factory=dict)
    worlds: dict[int, World] = field(default_factory=dict)
    commands: dict[int, list[IslandCommand | ArenaCommand]] = field(
        default_factory=dict
    )
    waiting: deque[tuple[int, Breed | Evaluate | Ask | AdvanceShard]] = field(
        default_factory=deque
    )

    def __post_init__(self) -> None:
        """Make the islands."""
        self.islands = archipelago(
            self.experiment, self.seed, self.run, self.founders, self.group
        )
        self.worlds = {number: World(distinct_fitness) for number in self.islands}
        self.commands = {number: [] for number in self.islands}
        own = {each: island_experiment(self.experiment, each) for each in self.islands}
        self.learners = Learners(own, Origin(seed=self.seed, run=self.run))

    def live(self, turns: int = 1_000_000) -> "ArchipelagoRun":
        """Run to the end, or for some turns."""
        if not any(self.commands.values()):
            self.start()
        for _ in range(turns):
            if not self.waiting:
                break
            self.turn()
        return self

    def start(self) -> None:
        for number in self.islands:
            self.tell(number, Started())

    def turn(self) -> None:
        """Answer one request."""
        self.waiting.rotate(-next(self.order) if self.order else 0)
        for _ in range(len(self.waiting)):
            if self.waiting[0][0] not in self.slow:
                break
            self.waiting.rotate(-1)
        number, asked = self.waiting.popleft()
        match asked:
            case Breed():
                self.tell(number, bred(self.islands[number], asked, self.verdict))
            case Evaluate():
                labels = self.experiment.measures.labels
                measures = drawn_measures(asked.birth, len(labels))
                fitness = self.fit(asked.birth, number)
                found = Evaluation(fitness, 0.1, 0.0, 12.0, measures)
                answer = Evaluated(
                    asked.birth, found, PROVENANCE, asked.trial, asked.requester
                )
                self.tell(number, answer)
            case Ask():
                self.tell(number, self.learners.answer(asked))
            case AdvanceShard():
                self.tell(number, self.worlds[number].advance(asked))

    def tell(self, number: int, event: Any) -> None:  # noqa: ANN401 - any event
        events = deque([(number, event)])
        while events:
            number, event = events.popleft()
            for command in self.islands[number].handle(event):
                self.commands[number].append(command)
                match command:
                    case Breed() | Evaluate() | Ask() | AdvanceShard():
                        self.waiting.append((number, command))
                        continue
                    case Emigrate():
                        sent: list[MigrationEvent] = [arrival(command)]
                    case Finish(island, neighbours):
                        sent = [NeighbourClosed(to, island) for to in neighbours]
                    case _:
                        continue
                for each in sent:
                    if each.island in self.islands:
                        events.append((each.island, each))
                    else:
                        self.outbox.put(each)

    def rows(self, table: str) -> list[Any]:
        """Return the rows of a table, island by island."""
        return [
            one.row
            for number in sorted(self.commands)
            for one in self.commands[number]
            if isinstance(one, Record) and one.table == table
        ]

    @property
    def outcome(self) -> dict[int, list[Any]]:
        """All rows of each island and its end: the reproducible part of a run."""
        return {
            number: [one for one in commands if isinstance(one, Record | Finish)]
            for number, commands in self.commands.items()
        }


def migrating(
    *islands: Islands,
    selection: SelectionSection = FEW,
    fit: Fit = distinct_on_islands,
    **migration: Any,  # noqa: ANN401 - any setting
) -> ArchipelagoRun:
    """Return islands in a ring, with some migration settings."""
    document = Experiment(
        name="test",
        selection=selection,
        islands=islands,
        migration=Migration(**{"topology": "ring", "epoch": 7, **migration}),
    )
    check_experiment(document, "test")
    return ArchipelagoRun(document, fit=fit)
