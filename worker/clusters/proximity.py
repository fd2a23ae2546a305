"""Proximity test: pairs of robots that may touch before the next check.

Two robots are to be merged when the distance between their bounding spheres is less
than ``merge_distance_m`` plus what both may move until the next check. That grows
with their speed, so that falling robots merge in time. Bounding boxes exclude almost
all pairs; only the others are measured.
"""

from functools import cached_property
from itertools import compress

import numpy as np

from schema.experiment.settings import ArenaSettings
from schema.robot.groups import Mask, overlaps
from schema.robot.ids import BirthId
from schema.robot.trace import Floats
from schema.wire.arena import Box
from worker.clusters.models import Indices
from worker.clusters.states import Layout, Pairs, RobotRows

FASTEST = 10.0
"""Speed above which the physics is broken; bounds the margin of a robot [m/s]."""
_ROUNDING_M = 1e-9
"""Upper bound on the rounding error of sums of distances."""


class RobotBounds:
    """Bounds of R robots at L moments; speeds (L, R) bound those of points [m/s]."""

    def __init__(
        self, layout: Layout, states: Floats, velocities: Floats | None = None
    ) -> None:
        """Compute the speeds in states (L, W), whose velocities (L, V) may be known."""
        self._layout, self._states = layout, states
        self.robot_rows = layout.robot_rows
        if velocities is None:
            velocities = layout.velocities(states)
        self.speeds = layout.speeds(velocities)

    @cached_property
    def _hulls(self) -> Floats:
        return self._layout.hulls(self._states)

    def are_near(self, pairs: Pairs, margins: Floats, gap_m: float) -> Mask:
        """Return whether P pairs of robots are near at each moment, (L, P).

        They are if the distance of a sphere of each is less than the sum of both
        margins, (L, R) [m], and a gap. Only spheres are measured whose bodies' hulls
        are near, seen from above.
        """
        found = np.zeros((len(margins), len(pairs)), dtype=np.bool_)
        if not pairs:
            return found
        here, there = np.array(pairs, dtype=np.intp).T
        limits = margins[:, here] + margins[:, there] + gap_m
        bodies, numbers = self._near_bodies(pairs, limits.max(axis=0) + _ROUNDING_M)
        if not len(numbers):
            return found
        first, second, counts = self._layout.robot_rows.sphere_pairs(*bodies)
        numbers = np.repeat(numbers, counts)
        is_near = self._distances(first, second) < limits[:, numbers]
        moments, spheres = is_near.nonzero()
        found[moments, numbers[spheres]] = True
        return found

    def _near_bodies(self, pairs: Pairs, limits: Floats) -> tuple[Indices, Indices]:
        """Return the bodies whose hulls may be near at a moment, seen from above.

        Of P > 0 pairs of robots, the limits (P,) are distances of two hulls [m].
        Returned are (2, N) pairs of bodies, and the pair of robots of each.
        """
        robot_rows = self._layout.robot_rows
        bodies = [robot_rows.body_pairs(*pair) for pair in pairs]
        numbers = np.repeat(np.arange(len(pairs)), [both.shape[1] for both in bodies])
        both = np.concatenate(bodies, axis=1)
        gaps = self._hulls.take(both[0], axis=2)
        gaps -= self._hulls.take(both[1], axis=2)
        gaps *= gaps
        reach = limits[numbers]
        reach += robot_rows.hulls[3].take(both).sum(axis=0)
        reach *= reach
        near = (gaps[:, 0] + gaps[:, 1] <= reach).any(axis=0).nonzero()[0]
        return both[:, near], numbers[near]

    def _distances(self, first: Indices, second: Indices) -> Floats:
        """Return the distances of pairs of spheres, (L, S) [m]."""
        radii = self._layout.robot_rows.radii
        # Most spheres occur in several pairs: each is computed once.
        is_wanted = np.zeros(len(radii), dtype=np.bool_)
        is_wanted[first] = is_wanted[second] = True
        spheres = self._layout.spheres(self._states, is_wanted.nonzero()[0])
        places = np.cumsum(is_wanted) - 1
        difference = spheres.take(places[first], axis=2)
        difference -= spheres.take(places[second], axis=2)
        difference *= difference
        distances = difference[:, 0] + difference[:, 1]
        distances += difference[:, 2]
        np.sqrt(distances, out=distances)
        distances -= radii[first]
        distances -= radii[second]
        return distances

    def boxes(self, margins: Floats) -> Floats:
        """Return the boxes around R robots at all moments, seen from above.

        They are (2, 2, R): least x, y, then greatest x, y [m], each extended by its
        margin, (R,) [m].
        """
        robot_rows = self.robot_rows
        low = self._hulls.min(axis=0) - robot_rows.hulls[3]
        high = self._hulls.max(axis=0) + robot_rows.hulls[3]
        low = np.minimum.reduceat(low, robot_rows.first_bodies, axis=1)
        high = np.maximum.reduceat(high, robot_rows.first_bodies, axis=1)
        return np.stack((low - margins, high + margins))

    def neighbours(self, boxes: Floats) -> tuple[list[int], list[int]]:
        """Return pairs of different clusters whose boxes, (2, 2, R), overlap.

        They are rows of the first and of the second robots, ascending by both.
        """
        cluster_indices = self._layout.cluster_indices
        is_near = overlaps(boxes)
        is_near &= cluster_indices[:, None] != cluster_indices
        first, second = is_near.nonzero()
        is_once = first < second
        return first[is_once].tolist(), second[is_once].tolist()


class Proximity:
    """The proximity test of an arena, by its settings."""

    def __init__(self, settings: ArenaSettings) -> None:
        arena, clock = settings.arena, settings.simulation
        self._swept: dict[RobotRows, Floats] = {}
        self._merge_m = arena.merge_distance_m
        self._split_m = max(arena.split_distance_m, arena.merge_distance_m)
        # Frames of bodies are one step old.
        self._ahead_s = (arena.proximity_steps + 1) * clock.timestep_s

    def pairs_to_merge(self, bounds: RobotBounds) -> list[Pairs]:
        """Return, for each moment of the bounds, the pairs whose clusters must merge.

        Valid as long as no robot changes its cluster.
        """
        margins = self._margins(bounds)
        most = margins.max(axis=0, initial=0.0) + (0.5 * self._merge_m + _ROUNDING_M)
        boxes = bounds.boxes(most)
        low, high = self._swept.get(bounds.robot_rows, boxes)
        around = np.minimum(low, boxes[0]), np.maximum(high, boxes[1])
        self._swept[bounds.robot_rows] = np.stack(around)
        pairs = list(zip(*bounds.neighbours(boxes), strict=True))
        is_near = bounds.are_near(pairs, margins, self._merge_m)
        return [list(compress(pairs, row)) for row in is_near.tolist()]

    def take_swept(self) -> dict[BirthId, Box]:
        """Return the boxes around all that checks for merges looked at, by robot.

        Of the checks since the last call, also of robots that are gone. Robots whose
        boxes do not overlap were not near each other at any of them.
        """
        swept: dict[BirthId, Box] = {}
        for robot_rows, boxes in self._swept.items():
            columns = boxes.reshape(4, -1).T.tolist()
            for birth, (w, s, e, n) in zip(robot_rows.rows, columns, strict=True):
                west, south, east, north = swept.get(birth, (w, s, e, n))
                box = min(w, west), min(s, south), max(e, east), max(n, north)
                swept[birth] = box
        self._swept = {}
        return swept

    def pairs_to_keep(self, bounds: RobotBounds, pairs: Pairs) -> Pairs:
        """Return which pairs of one cluster must stay in one cluster."""
        margins = self._margins(bounds)
        most = margins[0] + (0.5 * self._split_m + _ROUNDING_M)
        are_near = overlaps(bounds.boxes(most))[*zip(*pairs, strict=True)]
        pairs = list(compress(pairs, are_near.tolist()))
        is_near = bounds.are_near(pairs, margins, self._split_m)[0]
        return list(compress(pairs, is_near.tolist()))

    def _margins(self, bounds: RobotBounds) -> Floats:
        """Return how far each robot may move until the next check, (L, R) [m]."""
        return np.asarray(np.minimum(bounds.speeds, FASTEST) * self._ahead_s)
