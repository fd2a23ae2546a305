"""One network that is alone for all of its life, and so may plan it.

The same arithmetic as ``worker.controller.Bank``, equal to the last bit
(tests/worker/test_solo.py), at less than half of the cost of a bank of one.
"""

import numpy as np

from schema.evaluation import Floats
from worker.controller import STATE_LIMIT, Network, Widths

_LOWEST, _HIGHEST = np.array(-STATE_LIMIT), np.array(STATE_LIMIT)


class Solo:
    """A network that ticks from birth on, a known number of times at most.

    What an oscillator does depends on nothing but its age: it is computed before
    the first tick. What is not there, squeezed or linear neurons, costs nothing.

    Attributes:
        states: (S,) outputs and hidden states after the last tick.
    """

    def __init__(
        self, network: Network, width: Widths, tick_s: float, ticks: int
    ) -> None:
        """Start at state 0.

        Args:
            network: packed.
            width: with these widths.
            tick_s: time between two ticks [s].
            ticks: how many there will be at most.
        """
        self._weights = network.weights
        frequency, self._shift, self._scale, self._offset = network.numbers
        self._is_sigmoid, is_oscillator = network.kinds
        is_linear = (self._scale != 0.0) & ~self._is_sigmoid & ~is_oscillator
        self._has_sigmoids = bool(self._is_sigmoid.any())
        self._has_linears = bool(is_linear.any())
        # Inputs and previous states side by side, as the weights expect them.
        self._sources = np.zeros(width.inputs + width.states)
        self._readings = self._sources[: width.inputs]
        self.states = self._sources[width.inputs :]
        self._outputs = self.states[: width.outputs]
        self._next = np.empty(width.states)
        self._other = np.empty(width.states)
        self._oscillators = is_oscillator.nonzero()[0]
        ages = np.arange(ticks, dtype=np.float64)[:, np.newaxis] * tick_s
        chosen = self._oscillators
        angles = frequency[chosen] * ages - self._shift[chosen]
        swings = np.sin(angles) * self._scale[chosen] + self._offset[chosen]
        self._swings = list(np.clip(swings, -STATE_LIMIT, STATE_LIMIT))

    def step(self, readings: Floats, tick: int) -> Floats:
        """Tick once and return the outputs.

        Args:
            readings: (I,) sensor readings, finite; unused inputs 0.
            tick: number of the tick, 0 at birth.

        Returns:
            (O,) output states, a view that the next tick overwrites; finite, not
            yet clipped to [0, 1].
        """
        if self._has_sigmoids or self._has_linears:
            self._readings[:] = readings
            self._think()
        self.states[self._oscillators] = self._swings[tick]
        return self._outputs

    def _think(self) -> None:
        """Set all states but those of oscillators."""
        new, states = self._next, self.states
        self._weights.dot(self._sources, new)
        np.subtract(new, self._shift, out=new)
        if not self._has_linears:
            np.tanh(new, out=new)
        elif self._has_sigmoids:
            np.tanh(new, out=self._other)
            np.putmask(new, self._is_sigmoid, self._other)
        np.multiply(new, self._scale, out=new)
        if not self._has_linears:
            # Squeezed states never come near the limit.
            np.add(new, self._offset, out=states)
            return
        np.add(new, self._offset, out=new)
        np.maximum(new, _LOWEST, out=new)
        np.minimum(new, _HIGHEST, out=states)
