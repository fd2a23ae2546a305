"""Intervals that all clusters are stepped through, and their moments.

Clusters do not interact, so each is stepped to the end of an interval at once; then
the moments of the interval are handled one by one, for all clusters together.
"""

import numpy as np

from schema.experiment.settings import ArenaSettings
from schema.robot.results import Floats
from worker.clusters.columns import Layout
from worker.clusters.proximity import Pairs

MERGES_PER_SPLIT = 25
"""Clusters are checked for a split at every 25th check for merges."""
PLAUSIBLE = 1e6
"""Greatest plausible coordinate or velocity."""


class Schedule:
    """Steps of ticks, samples, and checks for merges and splits, in an arena.

    Attributes:
        tick_steps: between two ticks of the controllers.
    """

    def __init__(self, settings: ArenaSettings) -> None:
        """Read the intervals from an arena's settings."""
        clock, merge_steps = settings.simulation, settings.arena.proximity_steps
        self.tick_steps = clock.brain_steps
        self._sample_steps, self._merge_steps = clock.pose_steps, merge_steps
        self._split_steps = MERGES_PER_SPLIT * merge_steps

    def is_tick(self, step: int) -> bool:
        """Whether controllers tick at a step."""
        return step % self.tick_steps == 0

    def is_sample(self, step: int) -> bool:
        """Whether positions are sampled at a step."""
        return step % self._sample_steps == 0

    def is_merge(self, step: int) -> bool:
        """Whether clusters are checked for merges at a step."""
        return step % self._merge_steps == 0

    def is_split(self, step: int) -> bool:
        """Whether clusters are checked for splits, and merges, at a step."""
        return step % self._split_steps == 0

    def next_tick(self, step: int) -> int:
        """Return the first tick after a step."""
        return _next(step, self.tick_steps)

    def moments(self, step: int, until: int) -> tuple[int, ...]:
        """Return the moments of the interval that starts at a step, ascending.

        The last moment is a tick, a check for splits or ``until``: clusters cannot be
        stepped independently beyond it.
        """
        end = min(until, self.next_tick(step), _next(step, self._split_steps))
        found = {end}
        for interval in (self._sample_steps, self._merge_steps):
            found.update(range(_next(step, interval), end, interval))
        return tuple(sorted(found))


def _next(step: int, interval: int) -> int:
    return step - step % interval + interval


class Rollout:
    """States of all clusters at the K moments of an interval.

    Attributes:
        plan: steps to each moment from the one before.
        moment: the one that is being handled.
        states: (K, W) in the order of the layout.
        max_velocity: greatest absolute velocity of all; NaN if one is not a number.
        has_failures: whether the engine failed on a cluster.
        merge_pairs: pairs of rows to merge, by moment; computed on demand.
    """

    def __init__(self, plan: tuple[int, ...], is_merge: tuple[bool, ...]) -> None:
        """Initialise at the first moment, without states.

        Args:
            plan: steps to each moment from the one before.
            is_merge: whether each moment is a check for merges.
        """
        self.plan, self._is_merge = plan, is_merge
        self.moment = 0
        self.states = np.zeros((len(plan), 0))
        self.max_velocity = 0.0
        self.has_failures = False
        self.merge_pairs: dict[int, Pairs] = {}

    @property
    def state(self) -> Floats:
        """All clusters' state at the present moment, (W,)."""
        return np.asarray(self.states[self.moment])

    def merges_ahead(self) -> list[int]:
        """Return the checks for merges from the present moment on.

        Only the present one if the physics breaks in the interval.
        """
        if not np.abs(self.states).max(initial=0.0) <= PLAUSIBLE:
            return [self.moment]
        moments = range(self.moment, len(self.plan))
        return [moment for moment in moments if self._is_merge[moment]]

    def read(self, layout: Layout) -> None:
        """Read all states; drops pairs that were computed from the old ones."""
        self.states = layout.history(len(self.plan))
        velocities = np.abs(self.states.take(layout.velocities, axis=1))
        self.max_velocity = float(velocities.max(initial=0.0))
        self.has_failures = any(cluster.failure for cluster in layout.clusters)
        self.merge_pairs = {}
