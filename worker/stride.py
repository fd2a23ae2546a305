"""A stretch of time that all clusters have gone through, each at its own pace.

Clusters know nothing of each other, so each may be stepped to the end at once; then
what would have been seen on the way is looked at, moment by moment.
"""

import numpy as np

from schema.evaluation import Floats
from worker.layout import Layout


class Stride:
    """States of all clusters at K moments, and what bounds R robots then.

    Attributes:
        plan: steps to each moment from the one before.
        moment: the one that is being looked at.
        states: (K, N) positions, then velocities, as the layout puts them.
        moved: (K, R) how far any point is at most from where it was measured [m].
        speeds: (K, R) of the fastest points at most [m/s].
        loudest: the greatest absolute velocity of all; not a number if one is none.
    """

    def __init__(self, plan: tuple[int, ...]) -> None:
        """Begin with the first moment; nothing is known of any."""
        self.plan = plan
        self.moment = 0
        self.states = self.moved = self.speeds = np.zeros((len(plan), 0))
        self.loudest = 0.0

    @property
    def state(self) -> Floats:
        """What all are like at this moment, (N,)."""
        return np.asarray(self.states[self.moment])

    def read(self, layout: Layout) -> None:
        """Read all states; how far anybody moved is to be measured anew.

        Args:
            layout: where everybody is, from this moment on.
        """
        self.states = layout.history(len(self.plan))
        velocities = np.abs(self.states[:, layout.size :])
        self.loudest = float(velocities.max(initial=0.0))
        self.speeds = layout.speeds(velocities)
        self.moved = np.zeros_like(self.speeds)

    def measure(self, layout: Layout, anchor: Floats, first: int) -> None:
        """Compare the states from a moment on with a new anchor."""
        if first < len(self.plan):
            positions = self.states[first:, : layout.size]
            self.moved[first:] = layout.moved(np.abs(positions - anchor[: layout.size]))
