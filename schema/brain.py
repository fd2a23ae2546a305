"""Recurrent networks as data: neuron types, neurons, connections.

Formulas (a = weighted sum of inputs and of the previous states; facts of the
original, section 3.1):

* ``Simple``: gain * (a - bias)
* ``Sigmoid``: 1 / (1 + exp(-gain * (a - bias)))
* ``Oscillator``: 0.5 + amplitude / 2 * sin(2 pi (t / period - phase_offset));
  ignores its inputs; the phase is in periods; t is the robot's own age.
"""

import math
from dataclasses import dataclass
from typing import Literal

from schema.errors import InvalidRobot
from schema.parts import Parameter

Layer = Literal["input", "output", "hidden"]
LAYERS: tuple[Layer, ...] = ("input", "output", "hidden")

NEURON_TYPES: dict[str, tuple[Parameter, ...]] = {
    "Simple": (
        Parameter("bias", -1.0, 1.0, 0.0),
        Parameter("gain", 0.0, 1.0, 0.5),
    ),
    "Sigmoid": (
        Parameter("bias", -1.0, 1.0, 0.0),
        Parameter("gain", 0.0, 1.0, 0.5),
    ),
    "Oscillator": (
        Parameter("period", 0.0, 10.0, 5.0),
        Parameter("phase_offset", 0.0, 3.14, 0.0),
        Parameter("amplitude", 0.0, 2.0, 1.0),
    ),
}
"""Types that outputs and hidden neurons may have, with their parameters."""

INPUT = "Input"
"""Type of every input neuron; it has no parameters."""


@dataclass(frozen=True, slots=True)
class Neuron:
    """A neuron: ``part`` is the index of the part that owns it."""

    layer: Layer
    kind: str
    part: int
    parameters: tuple[float, ...] = ()


@dataclass(frozen=True, slots=True)
class Connection:
    """A weighted edge between two neurons, by their indices in the brain."""

    source: int
    target: int
    weight: float


@dataclass(frozen=True, slots=True)
class Brain:
    """A network: inputs first, then outputs, then hidden, each in part order.

    Attributes:
        neurons: in the order above; within a part in the order of its sensors.
        connections: at most one per ordered pair; no target is an input.
    """

    neurons: tuple[Neuron, ...] = ()
    connections: tuple[Connection, ...] = ()

    def count(self, layer: Layer) -> int:
        """Return the number of neurons in a layer."""
        return sum(neuron.layer == layer for neuron in self.neurons)


def check_brain(brain: Brain, part_count: int) -> None:
    """Raise unless a brain keeps the rules that every reader relies on.

    Args:
        brain: the brain.
        part_count: number of parts of its robot.

    Raises:
        InvalidRobot: neurons out of layer or part order, of unknown type, with a wrong
            number of parameters or not finite ones, on a part that does not
            exist; a connection to an input, to or from nowhere, or twice.
    """
    order = [(LAYERS.index(neuron.layer), neuron.part) for neuron in brain.neurons]
    if order != sorted(order):
        raise InvalidRobot(
            "brain.neurons: must be inputs, outputs, hidden in turn, "
            "each by ascending part"
        )
    for index, neuron in enumerate(brain.neurons):
        _check_neuron(neuron, f"brain.neurons[{index}]", part_count)
    seen: set[tuple[int, int]] = set()
    for index, edge in enumerate(brain.connections):
        _check_connection(edge, f"brain.connections[{index}]", brain)
        if (edge.source, edge.target) in seen:
            raise InvalidRobot(
                f"brain.connections[{index}]: second connection "
                f"{edge.source} -> {edge.target}, at most one is allowed"
            )
        seen.add((edge.source, edge.target))


def _check_neuron(neuron: Neuron, where: str, part_count: int) -> None:
    if not 0 <= neuron.part < part_count:
        raise InvalidRobot(
            f"{where}.part: must be 0..{part_count - 1}, got {neuron.part}"
        )
    if neuron.layer == "input":
        allowed: tuple[str, ...] = (INPUT,)
        expected = 0
    else:
        allowed = tuple(NEURON_TYPES)
        expected = len(NEURON_TYPES.get(neuron.kind, ()))
    if neuron.kind not in allowed:
        raise InvalidRobot(
            f"{where}.kind: must be one of {', '.join(allowed)}, got {neuron.kind!r}"
        )
    if len(neuron.parameters) != expected:
        raise InvalidRobot(
            f"{where}.parameters: {neuron.kind} takes {expected}, "
            f"got {len(neuron.parameters)}"
        )
    if not all(map(math.isfinite, neuron.parameters)):
        raise InvalidRobot(f"{where}.parameters: must be finite")


def _check_connection(edge: Connection, where: str, brain: Brain) -> None:
    count = len(brain.neurons)
    for name, index in (("source", edge.source), ("target", edge.target)):
        if not 0 <= index < count:
            raise InvalidRobot(f"{where}.{name}: must be 0..{count - 1}, got {index}")
    if brain.neurons[edge.target].layer == "input":
        raise InvalidRobot(f"{where}.target: neuron {edge.target} is an input")
    if not math.isfinite(edge.weight):
        raise InvalidRobot(f"{where}.weight: must be finite, got {edge.weight}")
