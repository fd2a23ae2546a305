"""Who may touch whom before anybody looks again.

Two robots are to meet when the distance between the spheres that cover them is less
than ``merge_distance_m`` and what both may move until the next look: that grows with
their speed, so that the falling meet in time. Boxes about robots tell of almost all
pairs that they are too far apart; only the others are measured.
"""

from functools import cached_property

import numpy as np
import numpy.typing as npt

from schema.experiment.settings import ArenaSettings
from schema.robot.results import Floats
from worker.clusters.columns import Layout, runs

FASTEST = 10.0
"""What is faster has broken the physics, and does not gather others [m/s]."""
_ROUNDING_M = 1e-9
"""What sums of distances may be off by, and more."""

Pairs = list[tuple[int, int]]
"""Rows of robots, the lesser first."""

Mask = npt.NDArray[np.bool_]


class Scene:
    """Where R robots are at L moments, as far as it matters to who meets whom.

    Attributes:
        speeds: (L, R) of the fastest point of each at most [m/s].
    """

    def __init__(self, layout: Layout, states: Floats) -> None:
        """Look at some states.

        Args:
            layout: where robots stand in them.
            states: (L, W).
        """
        self._layout, self._states = layout, states
        self.speeds = layout.speeds(states)

    @cached_property
    def _hulls(self) -> Floats:
        return self._layout.hulls(self._states)

    def apart(self, pairs: Pairs) -> Floats:
        """Return how far the spheres of P > 0 pairs of robots are apart, (L, P) [m].

        Each sphere of the one is measured against each of the other.
        """
        robot_rows = self._layout.robot_rows
        rows = sorted({row for pair in pairs for row in pair})
        counts = robot_rows.ball_counts[rows]
        wanted = runs(robot_rows.first_balls[rows], counts)
        balls, radii = (
            self._layout.balls(self._states, wanted),
            robot_rows.radii[wanted],
        )
        ends = np.cumsum(counts).tolist()
        spans = dict(zip(rows, map(slice, [0, *ends], ends), strict=False))
        found = np.empty((len(balls), len(pairs)))
        for number, (here, there) in enumerate(pairs):
            first, second = spans[here], spans[there]
            difference = balls[:, :, first, None] - balls[:, :, None, second]
            np.multiply(difference, difference, out=difference)
            distance = difference[:, 0] + difference[:, 1]
            distance += difference[:, 2]
            np.sqrt(distance, out=distance)
            distance -= radii[first, None]
            distance -= radii[second]
            found[:, number] = distance.min(axis=(1, 2))
        return found

    def is_near(self, here: int, there: int, within_m: float) -> bool:
        """Return whether the spheres of two robots may be as near as that.

        At one of the moments, and as far as the hulls of their bodies tell from
        above.
        """
        robot_rows = self._layout.robot_rows
        first, second = robot_rows.spans[here], robot_rows.spans[there]
        gaps = self._hulls[:, :, first, None] - self._hulls[:, :, None, second]
        gaps *= gaps
        radii = robot_rows.hulls[3]
        reach = (radii[first, None] + within_m) + radii[second]
        return bool((gaps[:, 0] + gaps[:, 1] <= reach * reach).any())

    def neighbours(self, margins: Floats) -> tuple[list[int], list[int]]:
        """Return those pairs that live apart and may be near each other.

        Args:
            margins: (R,) within which each robot keeps at every moment, besides its
                spheres [m].

        Returns:
            Rows of the first and of the second, ascending by both.
        """
        homes, robot_rows = self._layout.homes, self._layout.robot_rows
        if not len(homes):
            return [], []
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
        is_near &= homes[:, None] != homes
        first, second = is_near.nonzero()
        is_once = first < second
        return first[is_once].tolist(), second[is_once].tolist()


class Proximity:
    """What an arena's settings say of when robots are to live together."""

    def __init__(self, settings: ArenaSettings) -> None:
        """Take distances and intervals."""
        arena, clock = settings.arena, settings.simulation
        self._merge_m = arena.merge_distance_m
        self._split_m = max(arena.split_distance_m, arena.merge_distance_m)
        # Frames of bodies are those before the last step: one step older.
        self._ahead_s = (arena.proximity_steps + 1) * clock.timestep_s

    def meetings(self, scene: Scene) -> list[Pairs]:
        """Return of each moment of a scene who is to live with whom from then on.

        What is found at one moment holds for later ones as long as nobody moves.
        """
        margins = self._margins(scene)
        most = margins.max(axis=0, initial=0.0) + (0.5 * self._merge_m + _ROUNDING_M)
        pairs = [
            (here, there)
            for here, there in zip(*scene.neighbours(most), strict=True)
            if scene.is_near(here, there, float(most[here] + most[there]))
        ]
        if not pairs:
            return [[] for _ in margins]
        is_met = _are_near(scene, margins, pairs, self._merge_m)
        return [
            [pair for pair, is_one in zip(pairs, row, strict=True) if is_one]
            for row in is_met.tolist()
        ]

    def near(self, scene: Scene, pairs: Pairs) -> Pairs:
        """Return which of some pairs that live together are to go on doing so.

        Args:
            scene: of one moment.
            pairs: rows, one pair at least.
        """
        margins = self._margins(scene)
        is_near = _are_near(scene, margins, pairs, self._split_m)[0].tolist()
        return [pair for pair, is_one in zip(pairs, is_near, strict=True) if is_one]

    def _margins(self, scene: Scene) -> Floats:
        """Return how far each may move until the next look, (L, R) [m]."""
        return np.asarray(np.minimum(scene.speeds, FASTEST) * self._ahead_s)


def _are_near(scene: Scene, margins: Floats, pairs: Pairs, gap_m: float) -> Mask:
    """Return whether P pairs may come within a gap before the next look, (L, P)."""
    here, there = np.array(pairs, dtype=np.intp).reshape(-1, 2).T
    return np.asarray(scene.apart(pairs) < margins[:, here] + margins[:, there] + gap_m)
