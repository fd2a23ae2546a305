"""Who may touch whom before anybody looks again.

Of every pair of robots that live apart it is known how far they were apart at
least when they were last measured, and how far each can have moved since; only
pairs for which that says too little are measured. Two robots are to meet when the
distance is less than ``merge_distance_m`` and what both may move until the next
look: that grows with their speed, so that the falling meet in time.
"""

import math
from collections.abc import Callable, Sequence

import numpy as np

from schema.evaluation import Floats
from schema.settings import ArenaSettings
from worker.layout import Layout
from worker.reach import Reach

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
            order, then zeros for the velocities.
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
        self.gather((), Layout((), ()))

    def insert(self, row: int) -> None:
        """Make room for a newcomer, whose distance to nobody is known."""
        self.travel = np.insert(self.travel, row, 0.0)
        slack = np.insert(self.slack, row, -np.inf, axis=0)
        slack = np.insert(slack, row, -np.inf, axis=1)
        slack[np.tril_indices(len(slack))] = np.inf
        self.slack = slack

    def remove(self, rows: Sequence[int]) -> None:
        """Forget robots."""
        self.travel = np.delete(self.travel, rows)
        self.slack = np.delete(np.delete(self.slack, rows, axis=0), rows, axis=1)

    def gather(self, reaches: Sequence[Reach], layout: Layout) -> None:
        """Take the bounds of all robots and anchor them where they are now."""
        self._radius = [reach.radius for reach in reaches]
        self._radii = [reach.radii[:, None] for reach in reaches]
        self.anchor = layout.read()
        self.anchor[layout.size :] = 0.0

    def look(
        self, layout: Layout, state: Floats, differences: Floats, balls: Balls
    ) -> list[tuple[int, int]]:
        """Return the pairs of rows that are to live together from now on.

        Args:
            layout: where robots stand in the state.
            state: of all clusters in a row.
            differences: of the state from the anchor, absolute.
            balls: gives spheres, those that are needed.
        """
        moved, speeds = layout.bounds(differences)
        margins = np.minimum(speeds, FASTEST) * self._ahead_s
        self._margins = margins
        bound = self.travel + moved + (margins + 0.5 * self._merge_m)
        first, second = np.nonzero(self.slack < bound[:, None] + bound)
        # Few, as a rule: plain numbers are faster than arrays.
        due = list(zip(first.tolist(), second.tolist(), strict=True))
        if not due:
            return []
        for row in sorted({row for pair in due for row in pair}):
            self.travel[row] += moved[row]
            part = layout.part(row)
            self.anchor[part] = state[part]
        found, cache = [], dict[int, Floats]()
        places: dict[int, list[float]] = {}
        for a, b in due:
            for row in (a, b):
                if row not in places:
                    places[row] = state[layout.roots[row, :3]].tolist()
            meet = float(margins[a] + margins[b]) + self._merge_m
            apart = math.dist(places[a], places[b]) - self._radius[a] - self._radius[b]
            if apart < meet + _FAR_M:
                apart = self._distance(a, b, balls, cache)
            self.slack[a, b] = apart + self.travel[a] + self.travel[b]
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
        return found

    def join(self, rows: Sequence[int]) -> None:
        """Stop measuring the pairs of robots that live together."""
        ordered = sorted(rows)
        for number, row in enumerate(ordered):
            self.slack[row, ordered[number + 1 :]] = np.inf

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
