"""The sliding window over which a robot of an arena is judged.

The first sample is taken when the warm-up is over, so that neither the fall nor
the place in the air counts (traps B2, B19 of the original); from then on the
window holds the last ``window_steps``, its oldest and newest moments included.
"""

from collections import deque

import numpy as np

from schema.experiment.document import Simulation
from schema.parts import Vector
from schema.robot.results import Track

LEAST_SHARE = 0.25
"""Of the window that must have been lived before there is a fitness."""


class Window:
    """Where one robot was lately.

    Attributes:
        born: step at which it was born.
        positions: of the core's centre, oldest first, world frame [m].
    """

    def __init__(self, simulation: Simulation, born: int) -> None:
        """Start empty.

        Args:
            simulation: its clocks.
            born: the arena's step at birth.
        """
        self.born = born
        self._clock = simulation
        self._intervals = simulation.window_steps // simulation.pose_steps
        self.positions: deque[Vector] = deque(maxlen=self._intervals + 1)

    def add(self, step: int, position: Vector) -> None:
        """Take a sample of the arena's every ``pose_steps``.

        Args:
            step: the arena's.
            position: of the core's centre, world frame [m].
        """
        if step - self.born >= self._clock.warmup_steps:
            self.positions.append(position)

    @property
    def is_mature(self) -> bool:
        """Whether it has lived its warm-up and a whole window."""
        return len(self.positions) > self._intervals

    @property
    def is_judged(self) -> bool:
        """Whether enough of the window has been lived for a fitness."""
        return len(self.positions) - 1 >= max(1, LEAST_SHARE * self._intervals)

    def track(self) -> Track:
        """Return the samples as fitness functions want them; at least two."""
        interval_s = self._clock.pose_steps * self._clock.timestep_s
        return Track(interval_s, np.array(self.positions))
