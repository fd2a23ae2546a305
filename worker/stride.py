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
        states: (K, N) as the layout puts them.
        bounds: (K, 2, R) how far any point is at most from where it was measured
            [m], and the speed of the fastest point at most [m/s].
        loudest: no velocity of all is greater; not a number if one is none.
    """

    def __init__(self, plan: tuple[int, ...]) -> None:
        """Begin with the first moment; nothing is known of any."""
        self.plan = plan
        self.moment = 0
        self.states = np.zeros((len(plan), 0))
        self.bounds = np.zeros((len(plan), 2, 0))
        self.loudest = 0.0

    @property
    def state(self) -> Floats:
        """What all are like at this moment, (N,)."""
        return np.asarray(self.states[self.moment])

    def read(self, layout: Layout) -> None:
        """Read all states, from this moment on; they are to be measured anew."""
        self.states = layout.history(len(self.plan))
        self.bounds = np.zeros((len(self.plan), 2, len(layout.starts)))

    def measure(self, layout: Layout, anchor: Floats, first: int) -> None:
        """Compare the states from a moment on with an anchor.

        Args:
            layout: where everybody is.
            anchor: positions, and zeros for the velocities, (N,).
            first: the moment.
        """
        if first < len(self.plan):
            differences = np.abs(self.states[first:] - anchor)
            self.loudest = float(differences.max(initial=0.0))
            self.bounds[first:] = layout.bounds(differences)
