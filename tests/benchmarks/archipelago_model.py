"""Discrete-event simulation of an archipelago over several coordinators.

``python -m tests.benchmarks.archipelago_model`` prints a table of docs/scaling.md.

Islands in a ring evaluate a brood at a time; a worker that is free takes the job that
has waited longest, of any island. Each coordinator handles the answers of its islands
one after the other. An island whose epoch is over waits for those of its neighbours.
Evaluations are lognormally distributed. Dispatch, breeding and the network are free:
``tests.benchmarks.fleet_model`` has the first of them.
"""

from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, replace
from heapq import heappop, heappush
from itertools import count

import numpy as np

from tests.benchmarks.fleet_model import drawn_s

_SEED = 1
_BROODS = 21


@dataclass(frozen=True, slots=True)
class Archipelago:
    """Parameters of a simulation.

    Attributes:
        workers: cores that evaluate.
        islands: in a ring; island i belongs to group i modulo ``groups``.
        groups: coordinators.
        brood: births that an island evaluates at a time; it waits for the last one.
        epoch: births between two migrations; 0: none.
        evaluation_s: mean evaluation time [s].
        coordinator_s: CPU time of a coordinator per birth [s].
        spread: standard deviation of the logarithm of evaluation times.
    """

    workers: int
    islands: int
    groups: int
    brood: int = 15
    epoch: int = 150
    evaluation_s: float = 0.04
    coordinator_s: float = 0.0005
    spread: float = 0.5


@dataclass(frozen=True, slots=True)
class Shares:
    """Result of a simulation.

    Attributes:
        workers: share of their time in which workers are busy.
        coordinators: share of their time in which coordinators are busy.
        migration: share of their time in which islands wait for migrants.
        births_per_s: of all islands [1/s].
    """

    workers: float
    coordinators: float
    migration: float
    births_per_s: float


@dataclass(slots=True)
class _Island:
    """Births begun and open; epochs over; when it began to wait for migrants [s]."""

    births: int = 0
    open: int = 0
    epoch: int = 0
    since_s: float | None = None


class ArchipelagoModel:
    """Simulated archipelago."""

    def __init__(self, setting: Archipelago) -> None:
        self._setting = setting
        self._islands = [_Island() for _ in range(setting.islands)]
        self._rng = np.random.default_rng(_SEED)
        self._now_s = self._waited_s = self._busy_s = 0.0
        self._free, self._handled = setting.workers, 0
        # Jobs that wait, by island; times at which coordinators are done with all work.
        self._waiting: deque[int] = deque()
        self._ends_s = [0.0] * setting.groups
        self._agenda: list[tuple[float, int, Callable[[int], None], int]] = []
        self._order = count()

    def run(self) -> Shares:
        """Simulate until one island has finished its broods; return the shares."""
        own = self._setting
        for number in range(own.islands):
            self._begin(number)
        while max(each.births for each in self._islands) < _BROODS * own.brood:
            while self._free and self._waiting:
                self._evaluate(self._waiting.popleft())
            when_s, _, call, number = heappop(self._agenda)
            self._busy_s += (own.workers - self._free) * (when_s - self._now_s)
            self._now_s = when_s
            call(number)
        span_s = self._now_s
        return Shares(
            self._busy_s / (own.workers * span_s),
            self._handled * own.coordinator_s / (own.groups * span_s),
            self._waited_s / (own.islands * span_s),
            self._handled / span_s,
        )

    def _at(self, when_s: float, call: Callable[[int], None], number: int) -> None:
        heappush(self._agenda, (when_s, next(self._order), call, number))

    def _begin(self, number: int) -> None:
        """Begin a brood of an island."""
        island, brood = self._islands[number], self._setting.brood
        island.open = brood
        island.births += brood
        self._waiting.extend([number] * brood)

    def _evaluate(self, number: int) -> None:
        self._free -= 1
        setting = self._setting
        lasts_s = drawn_s(self._rng, setting.evaluation_s, setting.spread)
        self._at(self._now_s + lasts_s, self._answer, number)

    def _answer(self, number: int) -> None:
        """Queue an answer for the coordinator of an island."""
        self._free += 1
        group = number % self._setting.groups
        begin_s = max(self._now_s, self._ends_s[group])
        self._ends_s[group] = begin_s + self._setting.coordinator_s
        self._at(self._ends_s[group], self._handle, number)

    def _handle(self, number: int) -> None:
        self._handled += 1
        island, epoch = self._islands[number], self._setting.epoch
        island.open -= 1
        if island.open:
            return
        if not epoch or island.births // epoch == island.epoch:
            self._begin(number)
            return
        island.since_s = self._now_s
        for each in {number, *self._sides(number)}:
            self._migrate(each)

    def _sides(self, number: int) -> tuple[int, int]:
        """Return the neighbours of an island."""
        return (number - 1) % len(self._islands), (number + 1) % len(self._islands)

    def _migrate(self, number: int) -> None:
        """Begin the next epoch of an island if its neighbours have ended this one."""
        island = self._islands[number]
        sides = [self._islands[each] for each in self._sides(number)]
        if island.since_s is not None and all(
            side.epoch > island.epoch or side.since_s is not None for side in sides
        ):
            self._waited_s += self._now_s - island.since_s
            island.epoch, island.since_s = island.epoch + 1, None
            self._begin(number)


def main() -> None:
    """Print the shares for some settings."""
    small = Archipelago(1000, islands=128, groups=1)
    large = Archipelago(10_000, islands=2048, groups=1)
    rows = [
        *(replace(small, groups=n) for n in (1, 4, 16, 32)),
        *(replace(small, groups=16, islands=n) for n in (64, 256)),
        *(replace(small, groups=16, epoch=n) for n in (15, 0)),
        *(replace(small, groups=n, evaluation_s=1.0) for n in (1, 2)),
        *(replace(large, groups=n) for n in (16, 128, 256)),
        replace(large, evaluation_s=1.0),
    ]
    for each in rows:
        found = ArchipelagoModel(each).run()
        epoch = each.epoch or "none"
        cells = (each.workers, f"{each.evaluation_s:g} s", each.islands, each.groups)
        shares = (found.workers, found.coordinators, found.migration)
        texts = [*map(str, (*cells, epoch)), *(f"{100 * one:.0f} %" for one in shares)]
        print("|", " | ".join([*texts, f"{found.births_per_s:.0f}"]), "|", flush=True)


if __name__ == "__main__":
    main()
