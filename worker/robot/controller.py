"""Controllers: recurrent networks as arrays, in a batch or alone.

All networks of a batch have the widths of the experiment's limits, whatever robots
are in it, and each is one slice of every array. A robot's outputs are therefore
equal to the last bit alone, in any batch and at any place in it
(tests/worker/robot/test_controller.py). Formulas: ``schema.robot.brain``.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from math import pi

import numpy as np
import numpy.typing as npt

from schema.errors import InvalidRobot
from schema.experiment.document import Space
from schema.robot.brain import Brain, Neuron
from schema.robot.results import Floats

Mask = npt.NDArray[np.bool_]

STATE_LIMIT = 1e6
"""Bound on the states of linear neurons, which may feed back on themselves."""
SHORTEST_PERIOD_S = 1e-6
"""Least period of an oscillator, against a division by zero."""
_LOWEST, _HIGHEST = np.array(-STATE_LIMIT), np.array(STATE_LIMIT)
_NUMBER_LIMIT = 1e100
"""Bound on weights and parameters, so that no sum of products overflows."""


@dataclass(frozen=True, slots=True)
class Widths:
    """Numbers of input, output and hidden neurons of every network's arrays."""

    inputs: int
    outputs: int
    hidden: int

    @property
    def states(self) -> int:
        """Number of neurons that have a state."""
        return self.outputs + self.hidden


def widths(space: Space) -> Widths:
    """Return the widths of an experiment's limits."""
    return Widths(space.max_inputs, space.max_outputs, space.max_hidden)


@dataclass(frozen=True, slots=True)
class Network:
    """Brain as arrays: S states (outputs, then hidden), I inputs.

    A neuron's next state is scale * f(weights . sources + frequency * age - shift)
    + offset, where f is tanh for a sigmoid, sine for an oscillator and the identity
    for a linear neuron; gains are multiplied into the weights.

    Attributes:
        weights: (S, I + S), from inputs and previous states to each neuron.
        numbers: (4, S): frequency [rad/s], shift, scale, offset.
        kinds: (2, S): whether it is a sigmoid, whether it is an oscillator.
    """

    weights: Floats
    numbers: Floats
    kinds: Mask


def pack(brain: Brain, width: Widths) -> Network:
    """Return a brain as arrays of fixed width.

    Args:
        brain: a checked brain.
        width: of the arrays.

    Raises:
        InvalidRobot: more inputs, outputs or hidden neurons than the widths.
    """
    limits = {"input": width.inputs, "output": width.outputs, "hidden": width.hidden}
    first = {"input": 0, "output": width.inputs, "hidden": width.inputs + width.outputs}
    following = dict(first)
    places: list[int] = []
    for neuron in brain.neurons:
        places.append(following[neuron.layer])
        following[neuron.layer] += 1
    for layer, limit in limits.items():
        count = following[layer] - first[layer]
        if count > limit:
            raise InvalidRobot(
                f"brain: {layer} neurons must be <= {limit}, got {count}"
            )
    weights = np.zeros((width.states, width.inputs + width.states))
    numbers = np.zeros((4, width.states))
    kinds = np.zeros((2, width.states), dtype=np.bool_)
    for edge in brain.connections:
        row = places[edge.target] - width.inputs
        weights[row, places[edge.source]] = _bounded(edge.weight)
    for place, neuron in zip(places, brain.neurons, strict=True):
        if neuron.layer != "input":
            _set_neuron(neuron, place - width.inputs, (weights, numbers, kinds))
    return Network(weights, numbers, kinds)


def _set_neuron(neuron: Neuron, row: int, arrays: tuple[Floats, Floats, Mask]) -> None:
    """Write a neuron's row into the arrays of a network."""
    weights, numbers, kinds = arrays
    values = [_bounded(value) for value in neuron.parameters]
    if neuron.kind == "Oscillator":
        period, phase, amplitude = values
        frequency = 2.0 * pi / max(period, SHORTEST_PERIOD_S)
        weights[row] = 0.0
        numbers[:, row] = frequency, 2.0 * pi * phase, 0.5 * amplitude, 0.5
        kinds[1, row] = True
        return
    bias, gain = values
    scale = 1.0
    if neuron.kind == "Sigmoid":
        # 1 / (1 + exp(-a)) = (1 + tanh(a / 2)) / 2, which cannot overflow.
        gain, scale = 0.5 * gain, 0.5
        numbers[3, row] = 0.5
        kinds[0, row] = True
    weights[row] *= gain
    numbers[1:3, row] = gain * bias, scale


def _bounded(value: float) -> float:
    return min(max(value, -_NUMBER_LIMIT), _NUMBER_LIMIT)


class Bank:
    """R networks that are updated together; row r belongs to robot r.

    Attributes:
        states: (R, S) outputs and hidden states after the last tick; may be
            copied and written to save, move and restore robots.
    """

    def __init__(
        self, networks: Sequence[Network], width: Widths, tick_s: float
    ) -> None:
        """Start all networks at state 0.

        Args:
            networks: packed with ``width``.
            width: of the arrays.
            tick_s: time between two ticks [s].
        """
        count, states = len(networks), width.states
        self._tick_s = tick_s
        self._weights = np.empty((count, states, width.inputs + states))
        numbers = np.empty((4, count, states))
        kinds = np.empty((2, count, states), dtype=np.bool_)
        for row, network in enumerate(networks):
            self._weights[row] = network.weights
            numbers[:, row] = network.numbers
            kinds[:, row] = network.kinds
        self._frequency, self._shift, self._scale, self._offset = numbers
        self._is_sigmoid, self._is_oscillator = kinds
        self._has_sigmoids = bool(kinds[0].any())
        self._has_oscillators = bool(kinds[1].any())
        # Inputs and previous states side by side, as the weights expect them.
        self._sources = np.zeros((count, width.inputs + states, 1))
        self._readings = self._sources[:, : width.inputs, 0]
        self.states = self._sources[:, width.inputs :, 0]
        self._sums = np.empty((count, states, 1))
        self._next = self._sums[:, :, 0]
        self._other = np.empty((count, states))
        self._outputs = self.states[:, : width.outputs]

    def step(self, readings: Floats, age_ticks: Floats | float) -> Floats:
        """Update all networks once and return their outputs.

        Args:
            readings: (R, I) sensor readings, finite; unused inputs 0.
            age_ticks: (R, 1) ticks since each robot's own birth, or one number.

        Returns:
            (R, O) output states, a view that the next tick overwrites; finite,
            not yet clipped to [0, 1].
        """
        new, other = self._next, self._other
        self._readings[...] = readings
        np.matmul(self._weights, self._sources, out=self._sums)
        # Without oscillators, all frequencies are 0.
        if self._has_oscillators:
            np.multiply(self._frequency, age_ticks * self._tick_s, out=other)
            np.add(new, other, out=new)
        np.subtract(new, self._shift, out=new)
        if self._has_sigmoids:
            np.tanh(new, out=other)
            np.putmask(new, self._is_sigmoid, other)
        if self._has_oscillators:
            np.sin(new, out=other)
            np.putmask(new, self._is_oscillator, other)
        np.multiply(new, self._scale, out=new)
        np.add(new, self._offset, out=new)
        np.maximum(new, _LOWEST, out=new)
        np.minimum(new, _HIGHEST, out=self.states)
        return self._outputs


class SoloNetwork:
    """One network that is updated from birth on, with a known maximum of ticks.

    The same arithmetic as ``Bank``, equal to the last bit
    (tests/worker/robot/test_solo_network.py), at less than half of the cost of a
    bank of one. An oscillator's state depends only on its age; all its states are
    computed before the first tick. Kinds of neurons that the network lacks cost
    nothing.

    Attributes:
        readings: (1, I) sensor readings, which the caller writes before each tick;
            finite, unused inputs 0.
        states: (S,) outputs and hidden states after the last tick.
    """

    def __init__(
        self, network: Network, width: Widths, tick_s: float, ticks: int
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
        offsets[:, is_oscillator] = np.clip(waves, -STATE_LIMIT, STATE_LIMIT)
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
        np.maximum(new, _LOWEST, out=new)
        np.minimum(new, _HIGHEST, out=states)
