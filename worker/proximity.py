"""Who may touch whom before anybody looks again.

Of every pair of robots that live apart it is known how far they were apart at
least when they were last measured, and how far each can have moved since; only
pairs for which that says too little are measured. Two robots are to meet when the
distance is less than ``merge_distance_m`` and what both may move until the next
look: that grows with their speed, so that the falling meet in time.
"""

import math
from collections.abc import Callable, Mapping, Sequence

import numpy as np

from schema.evaluation import Floats
from schema.settings import ArenaSettings
from worker.layout import Layout

FASTEST = 10.0
"""What is faster has broken the physics, and does not gather others [m/s]."""
_FAR_M = 0.1
"""Beyond this gap of their whole spheres a pair is not measured more closely."""

Balls = Callable[[int], Floats]
"""Row of a robot to the (3, B) centres of its spheres, world frame [m]."""


class Proximity:
    """Distances between R robots, row by row in the order of their births.

    How far a point of a robot can have moved is bounded by how its configuration
    differs from one that is kept, its anchor; a robot that is measured is anchored
    anew, and what it had moved until then adds to its travel.

    Attributes:
        travel: (R,) how far each can have moved up to its anchor [m].
        slack: (R, R) upper triangle: distance at the last measurement plus both
            travels then [m]; infinite for pairs that live together.
        anchor: positions that the present ones are compared with, in the layout's
            order, and zeros for the velocities.
    """

    def __init__(self, settings: ArenaSettings) -> None:
        """Start with nobody.

        Args:
            settings: distances and intervals.
        """
        arena, clock = settings.arena, settings.simulation
        self._merge_m = arena.merge_distance_m
        self._split_m = max(arena.split_distance_m, arena.merge_distance_m)
        # Frames of bodies are those before the last step: one step older.
        self._ahead_s = (arena.proximity_steps + 1) * clock.timestep_s
        self.travel = np.zeros(0)
        self.slack = np.zeros((0, 0))
        self.anchor = np.zeros(0)
        self._margins = np.zeros(0)
        self._nearest = np.zeros(0)
        self._radius: list[float] = []
        self._radii: list[Floats] = []

    def insert(self, row: int) -> None:
        """Make room for a newcomer, whose distance to nobody is known."""
        self.travel = np.insert(self.travel, row, 0.0)
        count = len(self.travel)
        slack = np.full((count, count), np.inf)
        slack[:row, :row] = self.slack[:row, :row]
        slack[:row, row + 1 :] = self.slack[:row, row:]
        slack[row + 1 :, row + 1 :] = self.slack[row:, row:]
        slack[:row, row] = slack[row, row + 1 :] = -np.inf
        self.slack = slack

    def remove(self, rows: Sequence[int]) -> None:
        """Forget robots."""
        kept = np.ones(len(self.travel), dtype=np.bool_)
        kept[list(rows)] = False
        self.travel = self.travel[kept]
        self.slack = self.slack[kept][:, kept]

    def gather(self, layout: Layout, state: Floats) -> None:
        """Anchor all robots where they are now.

        Args:
            layout: where they stand.
            state: of all clusters in a row, not used otherwise.
        """
        self._radius, self._radii = layout.roster.radius, layout.roster.radii
        self.anchor = state
        self.anchor[layout.velocities] = 0.0
        self.refresh()

    def refresh(self) -> None:
        """Find for each robot the pair that says least, after pairs were changed."""
        self._nearest = self.slack.min(axis=1, initial=np.inf)

    def look(
        self,
        layout: Layout,
        state: Floats,
        bounds: Floats,
        balls: Balls,
    ) -> tuple[bool, list[tuple[int, int]]]:
        """Return whether anybody was measured, and who is to live with whom now.

        Args:
            layout: where robots stand in the state.
            state: of all clusters in a row.
            bounds: (2, R) how far each moved from its anchor, and how fast it is.
            balls: gives spheres, those that are needed.

        Returns:
            If anybody was anchored anew; and pairs of rows.
        """
        moved, speeds = bounds
        margins = np.minimum(speeds, FASTEST) * self._ahead_s
        self._margins = margins
        bound = self.travel + moved + (margins + 0.5 * self._merge_m)
        # Of few robots only may a pair be due, and few pairs are.
        rows = (self._nearest < bound + bound.max(initial=0.0)).nonzero()[0]
        if not len(rows):
            return False, []
        first, second = np.nonzero(self.slack[rows] < bound[rows, None] + bound)
        # Few, as a rule: plain numbers are faster than arrays.
        due = list(zip(rows[first].tolist(), second.tolist(), strict=True))
        if not due:
            return False, []
        ends = sorted({row for pair in due for row in pair})
        for row in ends:
            self.travel[row] += moved[row]
            part = layout.part(row)
            self.anchor[part] = state[part]
        roots = state[layout.roots[ends, :3]].tolist()
        found = self._measured(due, dict(zip(ends, roots, strict=True)), balls)
        for row in sorted({a for a, _ in due}):
            self._nearest[row] = self.slack[row].min()
        return True, found

    def _measured(
        self,
        due: Sequence[tuple[int, int]],
        places: Mapping[int, Sequence[float]],
        balls: Balls,
    ) -> list[tuple[int, int]]:
        """Measure pairs; return those that may touch before the next look."""
        found, cache = [], dict[int, Floats]()
        margins, travel = self._margins.tolist(), self.travel.tolist()
        for a, b in due:
            meet = margins[a] + margins[b] + self._merge_m
            apart = math.dist(places[a], places[b]) - self._radius[a] - self._radius[b]
            if apart < meet + _FAR_M:
                apart = self._distance(a, b, balls, cache)
            self.slack[a, b] = apart + travel[a] + travel[b]
            if apart < meet:
                found.append((a, b))
        return found

    def settle(self, moved: Floats) -> None:
        """Add to all travels what robots moved; they are anchored anew."""
        self.travel = self.travel + moved

    def near(
        self, pairs: Sequence[tuple[int, int]], balls: Balls
    ) -> list[tuple[int, int]]:
        """Return which of some pairs that live together are to go on doing so.

        Asked right after a look; the others are measured again at the next.
        """
        found, cache = [], dict[int, Floats]()
        for a, b in pairs:
            moves = float(self._margins[a] + self._margins[b])
            if self._distance(a, b, balls, cache) < moves + self._split_m:
                found.append((a, b))
            self.slack[a, b] = -np.inf
        self.refresh()
        return found

    def join(self, rows: Sequence[int]) -> None:
        """Stop measuring the pairs of robots that live together."""
        ordered = sorted(rows)
        for number, row in enumerate(ordered):
            self.slack[row, ordered[number + 1 :]] = np.inf
        self.refresh()

    def _distance(
        self, here: int, there: int, balls: Balls, cache: dict[int, Floats]
    ) -> float:
        """Return how far two robots are apart at least, from their spheres."""
        for row in (here, there):
            if row not in cache:
                cache[row] = balls(row)
        difference = cache[here][:, :, None] - cache[there][:, None, :]
        np.multiply(difference, difference, out=difference)
        distance = np.sqrt(difference[0] + difference[1] + difference[2])
        distance -= self._radii[here]
        distance -= self._radii[there].T
        return float(distance.min())
