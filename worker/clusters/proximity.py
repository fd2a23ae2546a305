"""Proximity test: pairs of robots that may touch before the next check.

Two robots are to be merged when the distance between their bounding spheres is less
than ``merge_distance_m`` plus what both may move until the next check. That grows
with their speed, so that falling robots merge in time. Bounding boxes exclude almost
all pairs; only the others are measured.
"""

from collections.abc import Iterable
from functools import cached_property
from itertools import compress

import numpy as np
import numpy.typing as npt

from schema.experiment.settings import ArenaSettings
from schema.robot.results import Floats
from worker.clusters.states import Layout, Pairs, runs

FASTEST = 10.0
"""Speed above which the physics is broken; bounds the margin of a robot [m/s]."""
_ROUNDING_M = 1e-9
"""Upper bound on the rounding error of sums of distances."""

Mask = npt.NDArray[np.bool_]


class Scene:
    """Bounds of R robots at L moments.

    Attributes:
        speeds: (L, R) upper bound on the speed of each robot's points [m/s].
    """

    def __init__(self, layout: Layout, states: Floats) -> None:
        """Compute the speeds.

        Args:
            layout: of the states.
            states: (L, W).
        """
        self._layout, self._states = layout, states
        self.speeds = layout.speeds(states)

    @cached_property
    def _hulls(self) -> Floats:
        return self._layout.hulls(self._states)

    def distances(self, pairs: Pairs) -> Floats:
        """Return the distances of P > 0 pairs of robots, (L, P) [m].

        The distance is the least one between a sphere of each.
        """
        robot_rows = self._layout.robot_rows
        rows = sorted({row for pair in pairs for row in pair})
        counts = robot_rows.sphere_counts[rows]
        wanted = runs(robot_rows.first_spheres[rows], counts)
        radii = robot_rows.radii[wanted]
        spheres = self._layout.spheres(self._states, wanted)
        ends = np.cumsum(counts).tolist()
        spans = dict(zip(rows, map(slice, [0, *ends], ends), strict=False))
        found = np.empty((len(spheres), len(pairs)))
        for number, (here, there) in enumerate(pairs):
            first, second = spans[here], spans[there]
            difference = spheres[:, :, first, None] - spheres[:, :, None, second]
            np.multiply(difference, difference, out=difference)
            distance = difference[:, 0] + difference[:, 1]
            distance += difference[:, 2]
            np.sqrt(distance, out=distance)
            distance -= radii[first, None]
            distance -= radii[second]
            found[:, number] = distance.min(axis=(1, 2))
        return found

    def may_be_near(self, pairs: Iterable[tuple[int, int]], margins: Floats) -> Pairs:
        """Return the pairs whose distance may fall below the sum of their margins.

        Tests the x-y distances of the hulls of their bodies, at all moments.

        Args:
            pairs: of robots.
            margins: (R,) of the robots [m].
        """
        pairs = list(pairs)
        if not pairs:
            return []
        robot_rows = self._layout.robot_rows
        bodies = [robot_rows.body_pairs(*pair) for pair in pairs]
        counts = [both.shape[1] for both in bodies]
        first, second = np.concatenate(bodies, axis=1)
        gaps = self._hulls.take(first, axis=2)
        gaps -= self._hulls.take(second, axis=2)
        gaps *= gaps
        here, there = np.array(pairs, dtype=np.intp).T
        limits = np.repeat(margins[here] + margins[there], counts)
        radii = robot_rows.hulls[3]
        limits += radii[first]
        limits += radii[second]
        limits *= limits
        is_near = (gaps[:, 0] + gaps[:, 1] <= limits).any(axis=0)
        starts = np.cumsum(counts) - counts
        return list(compress(pairs, np.logical_or.reduceat(is_near, starts).tolist()))

    def neighbours(self, margins: Floats) -> tuple[list[int], list[int]]:
        """Return pairs of different clusters whose bounding boxes overlap.

        Args:
            margins: (R,) that each robot's box is extended by [m].

        Returns:
            Rows of the first and of the second robots, ascending by both.
        """
        cluster_indices = self._layout.cluster_indices
        if not len(cluster_indices):
            return [], []
        is_near = self.overlaps(margins)
        is_near &= cluster_indices[:, None] != cluster_indices
        first, second = is_near.nonzero()
        is_once = first < second
        return first[is_once].tolist(), second[is_once].tolist()

    def overlaps(self, margins: Floats) -> Mask:
        """Return whether the bounding boxes of R > 0 robots overlap, (R, R).

        Args:
            margins: (R,) that each robot's box is extended by [m].
        """
        robot_rows = self._layout.robot_rows
        low = self._hulls.min(axis=0) - robot_rows.hulls[3]
        high = self._hulls.max(axis=0) + robot_rows.hulls[3]
        low = np.minimum.reduceat(low, robot_rows.first_bodies, axis=1)
        high = np.maximum.reduceat(high, robot_rows.first_bodies, axis=1)
        low -= margins
        high += margins
        is_near = low[0][:, None] <= high[0]
        is_beside = low[1][:, None] <= high[1]
        is_near &= is_beside
        is_near &= is_near.T.copy()
        return np.asarray(is_near)


class Proximity:
    """The proximity test of an arena, by its settings."""

    def __init__(self, settings: ArenaSettings) -> None:
        """Read distances and intervals from the settings."""
        arena, clock = settings.arena, settings.simulation
        self._merge_m = arena.merge_distance_m
        self._split_m = max(arena.split_distance_m, arena.merge_distance_m)
        # Frames of bodies are one step old.
        self._ahead_s = (arena.proximity_steps + 1) * clock.timestep_s

    def pairs_to_merge(self, scene: Scene) -> list[Pairs]:
        """Return, for each moment of a scene, the pairs whose clusters must merge.

        Valid as long as no robot changes its cluster.
        """
        margins = self._margins(scene)
        most = margins.max(axis=0, initial=0.0) + (0.5 * self._merge_m + _ROUNDING_M)
        neighbours = zip(*scene.neighbours(most), strict=True)
        pairs = scene.may_be_near(neighbours, most)
        if not pairs:
            return [[] for _ in margins]
        is_near = _are_near(scene, margins, pairs, self._merge_m)
        return [list(compress(pairs, row)) for row in is_near.tolist()]

    def pairs_to_keep(self, scene: Scene, pairs: Pairs) -> Pairs:
        """Return which pairs of one cluster must stay in one cluster.

        Args:
            scene: at one moment.
            pairs: at least one.
        """
        margins = self._margins(scene)
        most = margins[0] + (0.5 * self._split_m + _ROUNDING_M)
        overlaps = scene.overlaps(most)[*zip(*pairs, strict=True)]
        pairs = scene.may_be_near(compress(pairs, overlaps.tolist()), most)
        if not pairs:
            return []
        is_near = _are_near(scene, margins, pairs, self._split_m)[0]
        return list(compress(pairs, is_near.tolist()))

    def _margins(self, scene: Scene) -> Floats:
        """Return how far each robot may move until the next check, (L, R) [m]."""
        return np.asarray(np.minimum(scene.speeds, FASTEST) * self._ahead_s)


def _are_near(scene: Scene, margins: Floats, pairs: Pairs, gap_m: float) -> Mask:
    """Return whether P pairs may come within a gap before the next check, (L, P)."""
    here, there = np.array(pairs, dtype=np.intp).reshape(-1, 2).T
    return np.asarray(
        scene.distances(pairs) < margins[:, here] + margins[:, there] + gap_m
    )
