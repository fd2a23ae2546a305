"""Brains in workers: the brain types of experiments, and the brain of one robot."""

from collections.abc import Callable, Mapping, Sequence
from functools import lru_cache
from math import pi
from typing import Any

import numpy as np

from schema.errors import SimulationDiverged
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
from worker.robot.banks import (
    HIGHEST,
    LOWEST,
    GuardedBank,
    Mask,
    NetworkBank,
    PackedNetwork,
    story_of,
)
from worker.robot.check_controls import check_controls
from worker.robot.cpg import CpgControl
from worker.robot.modular import ModularControl
from worker.robot.own_neurons import OwnNeuron

_NUMBER_LIMIT = 1e100
"""Bound on weights and parameters, so that no sum of products overflows."""


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
    "modular": ModularControl,
}


class Controls:
    """Brains of one experiment; ``is_checked``: a user's states may be not finite."""

    def __init__(self, brain: BrainSection, space: Space, tick_s: float) -> None:
        """Load the brain type, which ``brain`` names.

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

    def guarded_bank(self, packed: Sequence[Any]) -> Bank:
        """Return brains at rest, guarded if their code is a user's."""
        if self.is_checked:
            return GuardedBank(self.bank, packed, self.width.outputs)
        return self.bank(packed)

    def rest(self) -> Floats:
        """Return the states of one brain at birth."""
        return np.zeros(self._rest)


@lru_cache(maxsize=64)
def controls_of(settings: EvaluationSettings | ArenaSettings) -> Controls:
    """Return the brains of a request's experiment."""
    return load_controls(settings.brain, settings.space, settings.simulation.tick_s)


@lru_cache(maxsize=64)
def load_controls(brain: BrainSection, space: Space, tick_s: float) -> Controls:
    """Return the brains of an experiment; see ``Controls``."""
    return Controls(brain, space, tick_s)


def pack(
    brain: Brain, width: Widths, types: Mapping[str, NeuronType] = BUILT_IN_NEURONS
) -> PackedNetwork:
    """Return a brain as arrays of fixed width."""
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


class SoloNetwork:
    """One network of the thesis's neuron types, with a known maximum of ticks.

    Equal to a ``NetworkBank`` of one to the last bit
    (tests/worker/robot/test_brains.py), at less than half of its cost. An
    oscillator's state depends only on its age; all its states are
    computed before the first tick. Kinds of neurons that the network lacks cost
    nothing.

    Attributes:
        readings: (1, I) those of the last tick; to write here saves a copy.
        states: (1, S) outputs and hidden states after the last tick.
    """

    def __init__(
        self, network: PackedNetwork, width: Widths, tick_s: float, ticks: int
    ) -> None:
        """Start at state 0; there are at most ``ticks`` ticks."""
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
        """Update the network once; see ``NetworkBank.step``."""
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
    """Return the checked brain of a robot that lives alone, as a bank of one.

    There are at most ``ticks`` ticks; it raises as ``Controls.pack`` does.
    """
    packed = controls.pack(brain)
    if isinstance(packed, PackedNetwork) and not packed.own:
        return SoloNetwork(packed, controls.width, controls.tick_s, ticks)
    return controls.guarded_bank([packed])
