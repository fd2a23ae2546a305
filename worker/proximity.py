"""Who may touch whom before anybody looks again.

Of every pair of robots that live apart it is known how far they were apart at
least when they were last measured, and how far each can have moved since; only
pairs for which that says too little are measured. Two robots are to meet when the
distance is less than ``merge_distance_m`` and what both may move until the next
look: that grows with their speed, so that the falling meet in time.
"""

from collections.abc import Callable, Sequence

import numpy as np

from schema.evaluation import Floats
from schema.experiment import ArenaSettings
from worker.reach import Indices, Reach

FASTEST = 10.0
"""What is faster has broken the physics, and does not gather others [m/s]."""
_FAR_M = 0.1
"""Beyond this gap of their whole spheres a pair is not measured more closely."""

Balls = Callable[[int], Floats]
"""Row of a robot to the (B, 3) centres of its spheres, world frame [m]."""


class Proximity:
    """Distances between R robots, row by row in the order of their births.

    Attributes:
        travel: (R,) how far each can have moved since it came [m].
        speeds: (R,) bounds at the last look [m/s].
        slack: (R, R) upper triangle: distance at the last measurement plus both
            travels then [m]; infinite for pairs that live together.
        looked: step of the last look.
    """

    def __init__(self, settings: ArenaSettings) -> None:
        """Start with nobody.

        Args:
            settings: distances and intervals.
        """
        arena, clock = settings.arena, settings.simulation
        self._merge_m = arena.merge_distance_m
        self._split_m = max(arena.split_distance_m, arena.merge_distance_m)
        self._timestep_s = clock.timestep_s
        # Frames of bodies are those before the last step: one step older.
        self._ahead_s = (arena.proximity_steps + 1) * clock.timestep_s
        self.travel = np.zeros(0)
        self.speeds = np.zeros(0)
        self.slack = np.zeros((0, 0))
        self.looked = 0
        self._set_reaches(())

    def insert(self, row: int) -> None:
        """Make room for a newcomer, whose distance to nobody is known."""
        self.travel = np.insert(self.travel, row, 0.0)
        self.speeds = np.insert(self.speeds, row, 0.0)
        slack = np.insert(self.slack, row, -np.inf, axis=0)
        slack = np.insert(slack, row, -np.inf, axis=1)
        slack[np.tril_indices(len(slack))] = np.inf
        self.slack = slack

    def remove(self, rows: Sequence[int]) -> None:
        """Forget robots."""
        self.travel = np.delete(self.travel, rows)
        self.speeds = np.delete(self.speeds, rows)
        self.slack = np.delete(np.delete(self.slack, rows, axis=0), rows, axis=1)

    def gather(self, reaches: Sequence[Reach]) -> None:
        """Take the bounds of all robots, after some came or went."""
        self._set_reaches(reaches)

    def _set_reaches(self, reaches: Sequence[Reach]) -> None:
        self._radius = np.array([reach.radius for reach in reaches])
        width = max((len(reach.radii) for reach in reaches), default=0)
        # Missing spheres have no size at all, and lose every comparison.
        self._radii = np.full((len(reaches), width), -1e9)
        for row, reach in enumerate(reaches):
            self._radii[row, : len(reach.radii)] = reach.radii

    def look(
        self, step: int, speeds: Floats, places: Floats, balls: Balls
    ) -> list[tuple[int, int]]:
        """Return the pairs of rows that are to live together from now on.

        Args:
            step: the arena's.
            speeds: (R,) bounds on the speed of each robot's fastest point [m/s].
            places: (R, 3) centres of the cores, world frame [m].
            balls: gives spheres, those that are needed.
        """
        elapsed_s = (step - self.looked) * self._timestep_s
        self.travel += np.maximum(speeds, self.speeds) * elapsed_s
        self.speeds, self.looked = speeds, step
        margins = self._margins()
        bound = self.travel + margins
        first, second = np.nonzero(self.slack < bound[:, None] + bound)
        if not len(first):
            return []
        gap = self._gaps(places, first, second)
        near = np.nonzero(gap < margins[first] + margins[second] + _FAR_M)[0]
        if len(near):
            gap[near] = self.distances(first[near], second[near], balls)
        self.slack[first, second] = gap + self.travel[first] + self.travel[second]
        close = gap < margins[first] + margins[second]
        return list(zip(first[close].tolist(), second[close].tolist(), strict=True))

    def near(self, first: Indices, second: Indices, balls: Balls) -> Indices:
        """Return which of some pairs that live together are to go on doing so."""
        margins = self._margins()
        apart = self.distances(first, second, balls)
        enough = np.maximum(
            self._split_m,
            margins[first] + margins[second] + self._split_m - self._merge_m,
        )
        self.slack[first, second] = apart + self.travel[first] + self.travel[second]
        return np.nonzero(apart < enough)[0]

    def join(self, rows: Sequence[int]) -> None:
        """Stop measuring the pairs of robots that live together."""
        ordered = sorted(rows)
        for number, row in enumerate(ordered):
            self.slack[row, ordered[number + 1 :]] = np.inf

    def part(self, first: int, second: int) -> None:
        """Have a pair that lives together no more measured at the next look."""
        self.slack[first, second] = -np.inf

    def _margins(self) -> Floats:
        """Return each robot's share of the distance at which a pair must meet."""
        moves = np.minimum(self.speeds, FASTEST) * self._ahead_s
        return np.asarray(moves + 0.5 * self._merge_m)

    def _gaps(self, places: Floats, first: Indices, second: Indices) -> Floats:
        apart = places[first] - places[second]
        squares = apart * apart
        distance = np.sqrt(squares[:, 0] + squares[:, 1] + squares[:, 2])
        return np.asarray(distance - self._radius[first] - self._radius[second])

    def distances(self, first: Indices, second: Indices, balls: Balls) -> Floats:
        """Return how far pairs are apart, (K,), at least, from their spheres.

        Every number is found by the same arithmetic whoever else is measured.
        """
        rows = np.unique(np.concatenate([first, second]))
        width = self._radii.shape[1]
        centres = np.zeros((len(rows), 3, width))
        for place, row in enumerate(rows.tolist()):
            found = balls(row)
            centres[place, :, : len(found)] = found.T
        a, b = np.searchsorted(rows, first), np.searchsorted(rows, second)
        total = np.zeros((len(first), width, width))
        for axis in range(3):
            apart = centres[a, axis, :, None] - centres[b, axis, None, :]
            np.multiply(apart, apart, out=apart)
            total += apart
        np.sqrt(total, out=total)
        total -= self._radii[first][:, :, None]
        total -= self._radii[second][:, None, :]
        return np.asarray(total.min(axis=(1, 2)))
