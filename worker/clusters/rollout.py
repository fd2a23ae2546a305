"""A stretch of time that all clusters have gone through, each at its own pace.

Clusters know nothing of each other, so each may be stepped to the end at once; then
what would have been seen on the way is looked at, moment by moment.
"""

import numpy as np

from schema.robot.results import Floats
from worker.clusters.columns import Layout
from worker.clusters.proximity import Pairs

PLAUSIBLE = 1e6
"""Beyond this a coordinate or a velocity is none."""


class Rollout:
    """States of all clusters at K moments.

    Attributes:
        plan: steps to each moment from the one before.
        moment: the one that is being looked at.
        states: (K, W) as the layout puts them.
        loudest: greatest velocity of all; not a number if one is none.
        has_failures: the engine may have given up on a cluster.
        meetings: pairs of rows to join, by moment of a look, as far as that has been
            found out.
    """

    def __init__(self, plan: tuple[int, ...], looks: tuple[bool, ...]) -> None:
        """Begin with the first moment; nothing is known of any.

        Args:
            plan: steps to each moment from the one before.
            looks: whether it is looked at each who may touch whom.
        """
        self.plan, self._looks = plan, looks
        self.moment = 0
        self.states = np.zeros((len(plan), 0))
        self.loudest = 0.0
        self.has_failures = False
        self.meetings: dict[int, Pairs] = {}

    @property
    def state(self) -> Floats:
        """What all are like at this moment, (W,)."""
        return np.asarray(self.states[self.moment])

    def looks_ahead(self) -> list[int]:
        """Return the moments of looks from this one on.

        Where physics breaks on the way, only this one.
        """
        if not np.abs(self.states).max(initial=0.0) <= PLAUSIBLE:
            return [self.moment]
        moments = range(self.moment, len(self.plan))
        return [moment for moment in moments if self._looks[moment]]

    def read(self, layout: Layout) -> None:
        """Read all states; what was found out of them holds no longer."""
        self.states = layout.history(len(self.plan))
        velocities = np.abs(self.states.take(layout.velocities, axis=1))
        self.loudest = float(velocities.max(initial=0.0))
        self.has_failures = any(cluster.failure for cluster in layout.clusters)
        self.meetings = {}
