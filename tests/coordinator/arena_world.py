"""World without physics: fitness is a function, and robots only have a place."""

from collections import deque
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Any

import msgspec
import numpy as np

from coordinator.arena.arena import Arena
from coordinator.islands.events import (
    Advanced,
    Append,
    ArenaCommand,
    ArenaEvent,
    Ask,
    Asked,
    Finish,
    Record,
    Started,
)
from schema.experiment.document import Experiment
from schema.experiment.file import read_experiment
from schema.robot.ids import BirthId
from schema.wire.arena import Advance, AdvanceShard, Casualty, Judgement, Touch
from schema.wire.messages import Breed
from schema.wire.poses import PoseArrays
from tests.coordinator.breeding import WhyNot, bred, viable
from tests.coordinator.reports import PROVENANCE

DT = 0.005
POSE_STEPS = 40
MATURE = 3000
"""Steps of 15 s: 3 s of warm-up and a window of 12 s."""
WINDOW = 2400

Fit = Callable[[BirthId, int], float]


def experiment(births: int = 3000, **arena: Any) -> Experiment:  # noqa: ANN401
    """Return scenario 3 with some other rules."""
    shipped = read_experiment("scenario3")
    assert shipped.arena is not None
    rules = msgspec.structs.replace(shipped.arena, **arena)
    return msgspec.structs.replace(shipped, births=births, arena=rules)


def equal_fitness(birth: BirthId, step: int) -> float:
    """Return the same fitness for all robots."""
    del birth, step
    return 0.1


def distinct_fitness(birth: BirthId, step: int) -> float:
    """Return a fitness in (0, 1) that differs between robots and steps."""
    return (birth.number * 0.6180339887498949 + step * 1e-5 + 0.1) % 1.0


def no_learner(ask: Ask) -> Asked:
    """Refuse requests to learners."""
    raise AssertionError(ask)


@dataclass
class World:
    """Robots, their births and places; ``diverges`` selects those that diverge."""

    fit: Fit = equal_fitness
    diverges: Callable[[BirthId, int], bool] = lambda _birth, _step: False
    step: int = 0
    born: dict[BirthId, int] = field(default_factory=dict)
    places: dict[BirthId, tuple[float, float]] = field(default_factory=dict)
    windows: dict[BirthId, int] = field(default_factory=dict)

    def advance(self, command: AdvanceShard) -> Advanced:
        """Return the result of an advance, as a worker does."""
        for birth in command.changes.removals:
            del self.born[birth]
        for each in command.changes.insertions:
            assert each.birth not in self.born
            self.born[each.birth] = self.step
            self.places[each.birth] = each.place
            self.windows[each.birth] = self.step + MATURE - WINDOW
        for change in command.changes.brains:
            assert change.birth in self.born
            if change.restarts_window:
                assert self.step >= self.windows[change.birth]
                self.windows[change.birth] = self.step
        self.step = command.until
        fallen = [one for one in sorted(self.born) if self.diverges(one, self.step)]
        casualties = tuple(
            Casualty(one, self.step - 1, "diverged: qacc", (*self.places[one], 0.5))
            for one in fallen
        )
        for one in fallen:
            del self.born[one]
        living = sorted(self.born)
        advance = Advance(
            step=self.step,
            digest=self.step.to_bytes(32, "big"),
            judgements=tuple(self.judged(one) for one in living),
            casualties=casualties,
            touches=tuple(Touch(a, b, 0.25) for a, b in pairwise(living[:3])),
            poses=poses(living, self.step * DT).message(),
        )
        return Advanced(
            command.island, command.number, advance, len(living), PROVENANCE
        )

    def judged(self, birth: BirthId) -> Judgement:
        age = self.step - self.born[birth]
        fitness = self.fit(birth, self.step)
        place = (*self.places[birth], 0.02)
        is_mature = self.step >= self.windows[birth] + WINDOW
        return Judgement(birth, age * DT, 0.0, fitness / 5, fitness, is_mature, place)


def poses(
    births: list[BirthId], *times_s: float, joints: Mapping[BirthId, int] | None = None
) -> PoseArrays:
    """Return a pose for each time and robot; one joint by default."""
    robots = births * len(times_s)
    counts = [joints[birth] if joints else 1 for birth in robots]
    return PoseArrays(
        islands=np.array([birth.island for birth in robots], np.int32),
        births=np.array([birth.number for birth in robots], np.int64),
        times_s=np.repeat(np.array(times_s, np.float64), len(births)),
        cores=np.tile(np.array([[0, 0, 0, 1, 0, 0, 0]], np.float32), (len(robots), 1)),
        joints=np.array(counts, np.int32),
        angles=np.full(sum(counts), 0.5, np.float32),
    )


@dataclass
class ArenaRun:
    """An arena, its world, and all events and commands."""

    arena: Arena
    world: World = field(default_factory=World)
    verdict: WhyNot = viable
    learner: Callable[[Ask], Asked] = no_learner
    order: Iterator[int] | None = None
    events: list[ArenaEvent] = field(default_factory=list)
    commands: list[ArenaCommand] = field(default_factory=list)
    waiting: deque[Breed | Ask | AdvanceShard] = field(default_factory=deque)

    def tell(self, event: ArenaEvent) -> list[ArenaCommand]:
        found = self.arena.handle(event)
        self.events.append(event)
        self.commands += found
        self.waiting += [
            one for one in found if isinstance(one, Breed | Ask | AdvanceShard)
        ]
        return found

    def turn(self) -> list[ArenaCommand]:
        """Answer one request."""
        self.waiting.rotate(-next(self.order) if self.order else 0)
        asked = self.waiting.popleft()
        if isinstance(asked, Breed):
            return self.tell(bred(self.arena, asked, self.verdict))
        if isinstance(asked, Ask):
            return self.tell(self.learner(asked))
        return self.tell(self.world.advance(asked))

    def live(self, until_s: float = 1e9) -> "ArenaRun":
        """Run to a time, or to the end."""
        if not self.events:
            self.tell(Started())
        while self.waiting and self.arena.next_step * DT <= until_s:
            self.turn()
        return self

    def rows(self, table: str) -> list[Any]:
        return [
            one.row
            for one in self.commands
            if isinstance(one, Record) and one.table == table
        ]

    @property
    def advances(self) -> list[AdvanceShard]:
        return [one for one in self.commands if isinstance(one, AdvanceShard)]

    @property
    def is_done(self) -> bool:
        return isinstance(self.commands[-1], Finish) and self.arena.is_finished

    @property
    def bulk(self) -> list[Append]:
        return [one for one in self.commands if isinstance(one, Append)]
