"""Brains of robots that live alone, updated from birth on."""

import numpy as np

from schema.plugins.protocols import Bank
from schema.robot.brain import Brain, Widths
from schema.robot.trace import Floats
from worker.robot.brains import HIGHEST, LOWEST, Controls, PackedNetwork
from worker.robot.guarded_bank import guarded_bank


class SoloNetwork:
    """One network of the thesis's neuron types, with a known maximum of ticks.

    The same arithmetic as ``NetworkBank``, equal to the last bit
    (tests/worker/robot/test_solo_brains.py), at less than half of the cost of a
    bank of one. An oscillator's state depends only on its age; all its states are
    computed before the first tick. Kinds of neurons that the network lacks cost
    nothing.

    Attributes:
        readings: (1, I) those of the last tick; to write here saves a copy.
        states: (1, S) outputs and hidden states after the last tick.
    """

    def __init__(
        self, network: PackedNetwork, width: Widths, tick_s: float, ticks: int
    ) -> None:
        """Start at state 0.

        Args:
            network: packed with ``width``.
            width: of the arrays.
            tick_s: time between two ticks [s].
            ticks: greatest number of ticks.
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
        self.states: Floats = self._sources[np.newaxis, width.inputs :]
        self._states = self.states[0]
        self._outputs = self.states[:, : width.outputs]
        self._next = np.empty(width.states)
        self._other = np.empty(width.states)
        ages = np.arange(ticks, dtype=np.float64)[:, np.newaxis] * tick_s
        angles = frequency[is_oscillator] * ages - self._shift[is_oscillator]
        waves = np.sin(angles) * scale[is_oscillator] + offset[is_oscillator]
        offsets = np.tile(offset, (ticks, 1))
        offsets[:, is_oscillator] = np.clip(waves, LOWEST, HIGHEST)
        self._offsets = list(offsets)

    def step(self, readings: Floats, age_ticks: Floats | float) -> Floats:
        """Update the network once; see ``NetworkBank.step``.

        Args:
            readings: (1, I) sensor readings, finite; unused inputs 0.
            age_ticks: number of the tick, 0 at birth.

        Returns:
            (1, O) output states, a view that the next tick overwrites.
        """
        if readings is not self.readings:
            self.readings[:] = readings
        offset = self._offsets[int(age_ticks)]
        if self._has_sigmoids or self._has_linears:
            self._update(offset)
        else:
            self._states[:] = offset
        return self._outputs

    def _update(self, offset: Floats) -> None:
        # ``out`` by position, not by name, saves a fifth of each call.
        new, states = self._next, self._states
        self._weights.dot(self._sources, new)
        np.subtract(new, self._shift, new)
        if not self._has_linears:
            np.tanh(new, new)
        elif self._has_sigmoids:
            np.tanh(new, self._other)
            np.putmask(new, self._is_sigmoid, self._other)
        np.multiply(new, self._scale, new)
        if not self._has_linears:
            # States of sigmoids stay far below the limit.
            np.add(new, offset, states)
            return
        np.add(new, offset, new)
        np.maximum(new, LOWEST, out=new)
        np.minimum(new, HIGHEST, out=states)


def solo_brain(controls: Controls, brain: Brain, ticks: int) -> Bank:
    """Return the brain of a robot that lives alone, as a bank of one.

    Args:
        controls: of its experiment.
        brain: a checked brain.
        ticks: greatest number of ticks.

    Raises:
        InvalidRobot, SimulationDiverged: as of ``Controls.pack``.
    """
    packed = controls.pack(brain)
    if isinstance(packed, PackedNetwork) and not packed.own:
        return SoloNetwork(packed, controls.width, controls.tick_s, ticks)
    return guarded_bank(controls, [packed])
