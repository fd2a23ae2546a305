"""One network that is alone for all of its life, and so may plan it.

The same arithmetic as ``worker.robot.controller.Bank``, equal to the last bit
(tests/worker/test_solo.py), at less than half of the cost of a bank of one.
"""

import numpy as np

from schema.robot.results import Floats
from worker.robot.controller import STATE_LIMIT, Network, Widths

_LOWEST, _HIGHEST = np.array(-STATE_LIMIT), np.array(STATE_LIMIT)


class Solo:
    """A network that ticks from birth on, a known number of times at most.

    What an oscillator does depends on nothing but its age: it is computed before
    the first tick, as what is added to its state, which is 0 otherwise. What is not
    there, squeezed or linear neurons, costs nothing.

    Attributes:
        readings: (1, I) what the sensors read; whoever lets it tick sets them
            before, finite, unused inputs 0.
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
        frequency, self._shift, scale, offset = network.numbers
        self._is_sigmoid, is_oscillator = network.kinds
        is_linear = (scale != 0.0) & ~self._is_sigmoid & ~is_oscillator
        self._has_sigmoids = bool(self._is_sigmoid.any())
        self._has_linears = bool(is_linear.any())
        self._scale = np.where(is_oscillator, 0.0, scale)
        # Inputs and previous states side by side, as the weights expect them.
        self._sources = np.zeros(width.inputs + width.states)
        self.readings: Floats = self._sources[np.newaxis, : width.inputs]
        self.states: Floats = self._sources[width.inputs :]
        self._outputs = self.states[: width.outputs]
        self._next = np.empty(width.states)
        self._other = np.empty(width.states)
        ages = np.arange(ticks, dtype=np.float64)[:, np.newaxis] * tick_s
        angles = frequency[is_oscillator] * ages - self._shift[is_oscillator]
        swings = np.sin(angles) * scale[is_oscillator] + offset[is_oscillator]
        offsets = np.tile(offset, (ticks, 1))
        offsets[:, is_oscillator] = np.clip(swings, -STATE_LIMIT, STATE_LIMIT)
        self._offsets = list(offsets)

    def step(self, tick: int) -> Floats:
        """Tick once, with the present readings, and return the outputs.

        Args:
            tick: number of the tick, 0 at birth.

        Returns:
            (O,) output states, a view that the next tick overwrites; finite, not
            yet clipped to [0, 1].
        """
        offset = self._offsets[tick]
        if self._has_sigmoids or self._has_linears:
            self._think(offset)
        else:
            self.states[:] = offset
        return self._outputs

    def _think(self, offset: Floats) -> None:
        """Set all states: weigh, squeeze, scale, add."""
        # With where to by its place, not by ``out=``: a fifth less of each call.
        new, states = self._next, self.states
        self._weights.dot(self._sources, new)
        np.subtract(new, self._shift, new)
        if not self._has_linears:
            np.tanh(new, new)
        elif self._has_sigmoids:
            np.tanh(new, self._other)
            np.putmask(new, self._is_sigmoid, self._other)
        np.multiply(new, self._scale, new)
        if not self._has_linears:
            # Squeezed states never come near the limit.
            np.add(new, offset, states)
            return
        np.add(new, offset, new)
        np.maximum(new, _LOWEST, out=new)
        np.minimum(new, _HIGHEST, out=states)
