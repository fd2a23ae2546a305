"""Brains of robots that live alone, updated from birth on."""

from typing import Any

import numpy as np

from schema.errors import SimulationDiverged
from schema.robot.brain import Brain, Widths
from schema.robot.results import Floats
from worker.robot.brains import HIGHEST, LOWEST, Controls, PackedNetwork
from worker.robot.guarded_bank import broken_rows, guarded_bank


class SoloNetwork:
    """One network of the thesis's neuron types, with a known maximum of ticks.

    The same arithmetic as ``NetworkBank``, equal to the last bit
    (tests/worker/robot/test_solo_brains.py), at less than half of the cost of a
    bank of one. An oscillator's state depends only on its age; all its states are
    computed before the first tick. Kinds of neurons that the network lacks cost
    nothing.

    Attributes:
        readings: (1, I) sensor readings, which the caller writes before each tick;
            finite, unused inputs 0.
        states: (S,) outputs and hidden states after the last tick.
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
        self.states: Floats = self._sources[width.inputs :]
        self._outputs = self.states[: width.outputs]
        self._next = np.empty(width.states)
        self._other = np.empty(width.states)
        ages = np.arange(ticks, dtype=np.float64)[:, np.newaxis] * tick_s
        angles = frequency[is_oscillator] * ages - self._shift[is_oscillator]
        waves = np.sin(angles) * scale[is_oscillator] + offset[is_oscillator]
        offsets = np.tile(offset, (ticks, 1))
        offsets[:, is_oscillator] = np.clip(waves, LOWEST, HIGHEST)
        self._offsets = list(offsets)

    def step(self, tick: int) -> Floats:
        """Update the network with the present readings and return the outputs.

        Args:
            tick: number of the tick, 0 at birth.

        Returns:
            (O,) output states, a view that the next tick overwrites; finite, not
            yet clipped to [0, 1].
        """
        offset = self._offsets[tick]
        if self._has_sigmoids or self._has_linears:
            self._update(offset)
        else:
            self.states[:] = offset
        return self._outputs

    def _update(self, offset: Floats) -> None:
        # ``out`` by position, not by name, saves a fifth of each call.
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
            # States of sigmoids stay far below the limit.
            np.add(new, offset, states)
            return
        np.add(new, offset, new)
        np.maximum(new, LOWEST, out=new)
        np.minimum(new, HIGHEST, out=states)


class SoloBank:
    """A bank of one brain, of any type.

    Attributes:
        readings: (1, I) sensor readings, which the caller writes before each tick.
    """

    def __init__(self, controls: Controls, packed: Any) -> None:  # noqa: ANN401
        """Start at rest.

        Args:
            controls: of the experiment.
            packed: a brain in the form of its brain type.
        """
        self.readings: Floats = np.zeros((1, controls.width.inputs))
        self._bank, self._tick_s = guarded_bank(controls, [packed]), controls.tick_s

    def step(self, tick: int) -> Floats:
        """Update the brain and return its outputs, (O,), not clipped.

        Raises:
            SimulationDiverged: code of a user that raised or gave no such array, or a
                state or output that is not finite.
        """
        outputs = self._bank.step(self.readings, float(tick))
        for reason in broken_rows(self._bank, outputs).values():
            what, _, why = reason.partition(": ")
            time_s = tick * self._tick_s
            raise SimulationDiverged(f"{what} by {time_s:.3f} s: {why}")
        first: Floats = outputs[0]
        return first


Solo = SoloNetwork | SoloBank


def solo_brain(controls: Controls, brain: Brain, ticks: int) -> Solo:
    """Return the brain of a robot that lives alone.

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
    return SoloBank(controls, packed)
