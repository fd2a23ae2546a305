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
from worker.layout import Layout
from worker.reach import Indices, Reach

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
        anchor: configurations that the present ones are compared with, in the
            layout's order.
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
        self.gather((), self.anchor)

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

    def gather(self, reaches: Sequence[Reach], positions: Floats) -> None:
        """Take the bounds and the anchors of all robots, after some came or went."""
        self._radius = np.array([reach.radius for reach in reaches])
        self._radii = [reach.radii[:, None] for reach in reaches]
        self.anchor = positions

    def look(
        self, layout: Layout, positions: Floats, speeds: Floats, balls: Balls
    ) -> list[tuple[int, int]]:
        """Return the pairs of rows that are to live together from now on.

        Args:
            layout: where robots stand in the positions.
            positions: of all clusters in a row.
            speeds: (R,) bounds on the speed of each robot's fastest point [m/s].
            balls: gives spheres, those that are needed.
        """
        moved = layout.moves(positions, self.anchor)
        margins = np.minimum(speeds, FASTEST) * self._ahead_s + 0.5 * self._merge_m
        self._margins = margins
        bound = self.travel + moved + margins
        first, second = np.nonzero(self.slack < bound[:, None] + bound)
        if not len(first):
            return []
        gap = self._gaps(positions[layout.roots[:, :3]], first, second)
        meet = margins[first] + margins[second]
        near = np.nonzero(gap < meet + _FAR_M)[0]
        if len(near):
            gap[near] = self.distances(first[near], second[near], balls)
        rows = np.unique(np.concatenate([first, second]))
        self._anchor(rows, moved[rows], layout, positions)
        self.slack[first, second] = gap + self.travel[first] + self.travel[second]
        close = gap < meet
        return list(zip(first[close].tolist(), second[close].tolist(), strict=True))

    def settle(self, moved: Floats) -> None:
        """Add to all travels what robots moved; they are anchored anew."""
        self.travel = self.travel + moved

    def _anchor(
        self, rows: Indices, moved: Floats, layout: Layout, positions: Floats
    ) -> None:
        self.travel[rows] += moved
        for row in rows.tolist():
            part = layout.part(row)
            self.anchor[part] = positions[part]

    def near(self, first: Indices, second: Indices, balls: Balls) -> Indices:
        """Return which of some pairs that live together are to go on doing so.

        Asked right after a look; the others are measured again at the next.
        """
        margins = self._margins
        apart = self.distances(first, second, balls)
        enough = margins[first] + margins[second] + self._split_m - self._merge_m
        self.slack[first, second] = -np.inf
        return np.nonzero(apart < np.maximum(self._split_m, enough))[0]

    def join(self, rows: Sequence[int]) -> None:
        """Stop measuring the pairs of robots that live together."""
        ordered = sorted(rows)
        for number, row in enumerate(ordered):
            self.slack[row, ordered[number + 1 :]] = np.inf

    def _gaps(self, places: Floats, first: Indices, second: Indices) -> Floats:
        apart = places[first] - places[second]
        squares = apart * apart
        distance = np.sqrt(squares[:, 0] + squares[:, 1] + squares[:, 2])
        return np.asarray(distance - self._radius[first] - self._radius[second])

    def distances(self, first: Indices, second: Indices, balls: Balls) -> Floats:
        """Return how far pairs are apart, (K,), at least, from their spheres.

        A pair's arithmetic does not depend on who else is measured.
        """
        cache: dict[int, Floats] = {}
        apart = np.empty(len(first))
        for number, pair in enumerate(
            zip(first.tolist(), second.tolist(), strict=True)
        ):
            for row in pair:
                if row not in cache:
                    cache[row] = balls(row)
            here, there = pair
            difference = cache[here][:, :, None] - cache[there][:, None, :]
            np.multiply(difference, difference, out=difference)
            distance = np.sqrt(difference[0] + difference[1] + difference[2])
            distance -= self._radii[here]
            distance -= self._radii[there].T
            apart[number] = distance.min()
        return apart
