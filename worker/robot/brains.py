"""Brains in workers: recurrent networks as arrays, and the brain types of experiments.

All networks of a batch have the widths of the experiment's limits, whatever robots
are in it, and each is one slice of every array. A robot's outputs are therefore
equal to the last bit alone, in any batch and at any place in it
(tests/worker/robot/test_brains.py). Formulas: ``schema.robot.brain``.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from math import pi
from typing import Any

import numpy as np
import numpy.typing as npt

from schema.errors import SimulationDiverged, cut, error_text
from schema.experiment.brains import NoParameters, brain_half, kinds_of, widths
from schema.experiment.document import BrainSection, Space
from schema.experiment.settings import ArenaSettings, EvaluationSettings
from schema.plugins.origin import naming_plugin
from schema.plugins.protocols import Bank, BrainControl, NeuronType
from schema.robot.brain import (
    Brain,
    Neuron,
    NeuronKinds,
    Widths,
    check_neurons,
    check_widths,
)
from schema.robot.neurons import BUILT_IN_NEURONS, SHORTEST_PERIOD_S
from schema.robot.trace import Floats
from worker.robot.check_controls import check_controls
from worker.robot.cpg import CpgControl
from worker.robot.own_neurons import STATE_LIMIT, OwnNeuron, OwnNeurons

Mask = npt.NDArray[np.bool_]
LOWEST, HIGHEST = np.array(-STATE_LIMIT), np.array(STATE_LIMIT)
"""Bounds on the states of neurons."""
_NUMBER_LIMIT = 1e100
"""Bound on weights and parameters, so that no sum of products overflows."""


@dataclass(frozen=True, slots=True)
class PackedNetwork:
    """Brain as arrays: S states (outputs, then hidden), I inputs.

    The next state of a neuron of the thesis's types is
    scale * f(weights . sources + frequency * age - shift) + offset, where f is tanh
    for a sigmoid, sine for an oscillator and the identity for a linear neuron; gains
    are multiplied into the weights. That of a neuron of a user's type depends on
    weights . sources.

    Attributes:
        weights: (S, I + S), from inputs and previous states to each neuron.
        numbers: (4, S): frequency [rad/s], shift, scale, offset.
        kinds: (2, S): whether it is a sigmoid, whether it is an oscillator.
        own: neurons of users' types.
    """

    weights: Floats
    numbers: Floats
    kinds: Mask
    own: tuple[OwnNeuron, ...] = ()


class NetworkBank:
    """R networks that are updated together; row r belongs to robot r.

    Attributes:
        states: (R, K S) outputs and hidden states after the last tick, then the other
            states of neurons of users' types; may be copied and written to save, move
            and restore robots.
    """

    def __init__(
        self,
        networks: Sequence[PackedNetwork],
        width: Widths,
        tick_s: float,
        values: int = 1,
    ) -> None:
        """Start all networks at state 0.

        Args:
            networks: packed with ``width``.
            width: of the arrays.
            tick_s: time between two ticks [s].
            values: greatest number of states of a neuron, K.
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
        memory = np.zeros((count, width.inputs + values * states, 1))
        self._sources = memory[:, : width.inputs + states]
        self._readings = memory[:, : width.inputs, 0]
        self.states = memory[:, width.inputs :, 0]
        self._first_states = self.states[:, :states]
        self._own: OwnNeurons | None = None
        if any(network.own for network in networks):
            self._own = OwnNeurons([network.own for network in networks], states)
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
        if self._own is not None:
            self._own.update(new, self.states, age_ticks, self._tick_s)
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
        if self._own is not None:
            self._own.write(new, self.states)
        np.maximum(new, LOWEST, out=new)
        np.minimum(new, HIGHEST, out=self._first_states)
        return self._outputs


class NetworkControl:
    """The thesis's recurrent network, of any neuron types."""

    def __init__(self, _: NoParameters, types: tuple[NeuronType, ...]) -> None:
        self.neurons: NeuronKinds = kinds_of(types)
        self._types = {kind.name: kind for kind in types}
        self._values = max(kind.states for kind in types)

    def pack(self, brain: Brain, width: Widths) -> PackedNetwork:
        """Return a brain as arrays."""
        return pack(brain, width, self._types)

    def bank(
        self, packed: Sequence[PackedNetwork], width: Widths, tick_s: float
    ) -> NetworkBank:
        """Return networks that are updated together."""
        return NetworkBank(packed, width, tick_s, self._values)


BUILT_IN: Mapping[str, Callable[[Any, tuple[NeuronType, ...]], BrainControl]] = {
    "network": NetworkControl,
    "cpg": CpgControl,
}


def outputs_of(found: object, robots: int, outputs: int) -> Floats:
    """Return what a bank's ``step`` has returned, (R, O).

    Raises:
        TypeError: complex numbers, or no numbers.
        ValueError: another shape.
    """
    numbers = np.asarray(found).astype(np.float64, casting="same_kind", copy=False)
    if numbers.shape != (robots, outputs):
        raise ValueError(
            f"step must return (R, O) = {(robots, outputs)}, got {numbers.shape}"
        )
    return numbers


def story_of(error: Exception) -> str:
    """Return why a user's brain failed, as the end of a message of one line."""
    if isinstance(error, SimulationDiverged):
        return str(error)
    return cut(error_text(error))


class Controls:
    """Brains of one experiment in a worker.

    Attributes:
        width: greatest numbers of neurons.
        tick_s: time between two ticks [s].
        neurons: types of output and hidden neurons by name.
        is_checked: states may be not finite, because the code is a user's.
    """

    def __init__(self, brain: BrainSection, space: Space, tick_s: float) -> None:
        """Load the brain type.

        Args:
            brain: names it.
            space: limits and neuron types.
            tick_s: time between two ticks [s].

        Raises:
            UnknownPlugin: no such brain type or neuron type.
            ExperimentError: one that breaks its contract, or wrong parameters.
        """
        self.width = widths(space)
        self.is_checked = any(":" in path for path in (brain.type, *space.neuron_types))
        self._control = brain_half(brain, space, BUILT_IN)
        self.tick_s = tick_s
        self.neurons = self._control.neurons
        if self.is_checked:
            with naming_plugin("brain.type", self._control):
                check_controls(self)
        self._rest = self.bank(()).states.shape[1]

    def check(self, brain: Brain) -> None:
        """Raise unless a checked brain has neurons of these types and widths.

        Raises:
            InvalidRobot: neurons of other types than the experiment's, or too many.
        """
        check_neurons(brain, self.neurons)
        check_widths(brain, self.width)

    def pack(self, brain: Brain) -> Any:  # noqa: ANN401 - a brain type's own
        """Return a checked brain in the form that ``bank`` takes.

        Raises:
            InvalidRobot: as of ``check``.
            SimulationDiverged: code of a user that raised, here or in ``bank``.
        """
        self.check(brain)
        try:
            packed = self._control.pack(brain, self.width)
            if self.is_checked:
                self.bank([packed])
        except Exception as error:
            raise SimulationDiverged(f"brain failed: {story_of(error)}") from error
        return packed

    def bank(self, packed: Sequence[Any]) -> Bank:
        """Return brains at rest that are updated together."""
        return self._control.bank(packed, self.width, self.tick_s)

    def rest(self) -> Floats:
        """Return the states of one brain at birth."""
        return np.zeros(self._rest)


@lru_cache(maxsize=64)
def controls_of(settings: EvaluationSettings | ArenaSettings) -> Controls:
    """Return the brains of a request's experiment; see ``Controls``."""
    return load_controls(settings.brain, settings.space, settings.simulation.tick_s)


@lru_cache(maxsize=64)
def load_controls(brain: BrainSection, space: Space, tick_s: float) -> Controls:
    """Return the brains of an experiment; see ``Controls``."""
    return Controls(brain, space, tick_s)


def pack(
    brain: Brain,
    width: Widths,
    types: Mapping[str, NeuronType] = BUILT_IN_NEURONS,
) -> PackedNetwork:
    """Return a brain as arrays of fixed width.

    Args:
        brain: a checked brain that fits the widths.
        width: of the arrays.
        types: neuron types by name.
    """
    first = {"input": 0, "output": width.inputs, "hidden": width.inputs + width.outputs}
    following = dict(first)
    places: list[int] = []
    for neuron in brain.neurons:
        places.append(following[neuron.layer])
        following[neuron.layer] += 1
    weights = np.zeros((width.states, width.inputs + width.states))
    numbers = np.zeros((4, width.states))
    kinds = np.zeros((2, width.states), dtype=np.bool_)
    for edge in brain.connections:
        row = places[edge.target] - width.inputs
        weights[row, places[edge.source]] = _bounded(edge.weight)
    own: list[OwnNeuron] = []
    for place, neuron in zip(places, brain.neurons, strict=True):
        if neuron.layer == "input":
            continue
        kind, row = types[neuron.kind], place - width.inputs
        if kind is BUILT_IN_NEURONS.get(neuron.kind):
            _set_neuron(neuron, row, (weights, numbers, kinds))
        else:
            own.append(OwnNeuron(kind, row, tuple(map(_bounded, neuron.parameters))))
    return PackedNetwork(weights, numbers, kinds, tuple(own))


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
