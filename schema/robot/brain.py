"""Brains as data: neuron types, neurons, connections.

Formulas of the thesis's network (a = weighted sum of inputs and of the previous
states; from the code of the original):

* ``Simple``: gain * (a - bias)
* ``Sigmoid``: 1 / (1 + exp(-gain * (a - bias)))
* ``Oscillator``: 0.5 + amplitude / 2 * sin(2 pi (t / period - phase_offset));
  ignores its inputs; the phase is in periods; t is the robot's own age.
"""

import math
from collections.abc import Mapping
from typing import Annotated, Literal

from msgspec import Meta, Struct

from schema.errors import InvalidRobot, shown
from schema.limits import MOST_CONNECTIONS, MOST_NEURONS, Finite
from schema.parts import Parameter

Layer = Literal["input", "output", "hidden"]
LAYERS: tuple[Layer, ...] = ("input", "output", "hidden")

NeuronKinds = Mapping[str, tuple[Parameter, ...]]
"""Types of output and hidden neurons by name, with their parameters."""

_WEIGHTED = (Parameter("bias", -1.0, 1.0, 0.0), Parameter("gain", 0.0, 1.0, 0.5))
NEURON_TYPES: dict[str, tuple[Parameter, ...]] = {
    "Simple": _WEIGHTED,
    "Sigmoid": _WEIGHTED,
    "Oscillator": (
        Parameter("period", 0.0, 10.0, 5.0, unit="s"),
        Parameter("phase_offset", 0.0, 3.14, 0.0, unit="periods"),
        Parameter("amplitude", 0.0, 2.0, 1.0),
    ),
}
"""The thesis's types of output and hidden neurons, with their parameters."""

INPUT = "Input"
"""Type of all input neurons; it has no parameters."""
_SHORT: dict[Layer, str] = {"input": "in", "output": "out", "hidden": "hidden"}


class Widths(Struct, frozen=True):
    """Greatest numbers of input, output and hidden neurons in an experiment."""

    inputs: int
    outputs: int
    hidden: int

    @property
    def states(self) -> int:
        """Number of output and hidden neurons."""
        return self.outputs + self.hidden


class Neuron(
    Struct, frozen=True, gc=False, array_like=True, forbid_unknown_fields=True
):
    """Neuron; ``part`` is the index of its part."""

    layer: Layer
    kind: str
    part: int
    parameters: tuple[Finite, ...] = ()


class Connection(
    Struct, frozen=True, gc=False, array_like=True, forbid_unknown_fields=True
):
    """Weighted edge between two neurons, given by their indices in the brain."""

    source: int
    target: int
    weight: Finite


class Brain(Struct, frozen=True, gc=False, array_like=True, forbid_unknown_fields=True):
    """Network: inputs, then outputs, then hidden neurons, each in part order.

    Attributes:
        neurons: in the order above; within a part in the order of its sensors.
        connections: at most one per ordered pair; no target is an input.
    """

    neurons: Annotated[tuple[Neuron, ...], Meta(max_length=MOST_NEURONS)] = ()
    connections: Annotated[
        tuple[Connection, ...], Meta(max_length=MOST_CONNECTIONS)
    ] = ()

    def count(self, layer: Layer) -> int:
        """Return the number of neurons in a layer."""
        return sum(neuron.layer == layer for neuron in self.neurons)


def check_brain(brain: Brain, part_count: int) -> None:
    """Raise ``InvalidRobot`` unless a brain keeps the rules that depend on no plug-in.

    ``check_neurons`` checks the types of its neurons.
    """
    order = [(LAYERS.index(neuron.layer), neuron.part) for neuron in brain.neurons]
    if order != sorted(order):
        rule = "inputs, then outputs, then hidden neurons, each by ascending part"
        raise InvalidRobot(f"brain.neurons: must be {rule}")
    # Build messages only on errors: this runs for each birth in each process.
    for index, neuron in enumerate(brain.neurons):
        if problem := _neuron_problem(neuron, part_count):
            raise InvalidRobot(f"brain.neurons[{index}]{problem}")
    seen: set[tuple[int, int]] = set()
    for index, edge in enumerate(brain.connections):
        if problem := _connection_problem(edge, brain):
            raise InvalidRobot(f"brain.connections[{index}]{problem}")
        if (edge.source, edge.target) in seen:
            second = f"second connection {edge.source} -> {edge.target}"
            raise InvalidRobot(f"brain.connections[{index}]: {second}, not allowed")
        seen.add((edge.source, edge.target))


def _neuron_problem(neuron: Neuron, part_count: int) -> str:
    if not 0 <= neuron.part < part_count:
        return f".part: must be 0..{part_count - 1}, got {neuron.part}"
    if neuron.layer == "input" and neuron.kind != INPUT:
        return f".kind: must be one of {INPUT}, got {shown(neuron.kind)}"
    if neuron.layer == "input" and len(neuron.parameters):
        return f".parameters: {INPUT} takes 0, got {len(neuron.parameters)}"
    if not all(map(math.isfinite, neuron.parameters)):
        return ".parameters: must be finite"
    return ""


def check_neurons(brain: Brain, kinds: NeuronKinds) -> None:
    """Raise ``InvalidRobot`` unless output and hidden neurons are of known types."""
    for index, neuron in enumerate(brain.neurons):
        if neuron.layer == "input":
            continue
        parameters = kinds.get(neuron.kind)
        if parameters is None:
            rule = f"must be one of {', '.join(kinds)}, got {shown(neuron.kind)}"
            raise InvalidRobot(f"brain.neurons[{index}].kind: {rule}")
        if (count := len(neuron.parameters)) != len(parameters):
            rule = f"{neuron.kind} takes {len(parameters)}, got {count}"
            raise InvalidRobot(f"brain.neurons[{index}].parameters: {rule}")


def check_widths(brain: Brain, width: Widths) -> None:
    """Raise ``InvalidRobot`` if a brain has more neurons than an experiment allows."""
    limits: dict[Layer, tuple[str, int]] = {
        "input": ("max_inputs", width.inputs),
        "output": ("max_outputs", width.outputs),
        "hidden": ("max_hidden", width.hidden),
    }
    for layer, (key, limit) in limits.items():
        if (count := brain.count(layer)) > limit:
            rule = f"must be <= space.{key} = {limit}, got {count}"
            raise InvalidRobot(f"brain: {layer} neurons {rule}")


def neuron_names(brain: Brain, part_ids: list[str]) -> list[str]:
    """Return a name for each neuron: ``<part>-in-k``, ``-out-k``, ``-hidden-k``."""
    counts: dict[str, int] = {}
    names = []
    for neuron in brain.neurons:
        stem = f"{part_ids[neuron.part]}-{_SHORT[neuron.layer]}"
        counts[stem] = counts.get(stem, -1) + 1
        names.append(f"{stem}-{counts[stem]}")
    return names


def _connection_problem(edge: Connection, brain: Brain) -> str:
    count = len(brain.neurons)
    for name, end in (("source", edge.source), ("target", edge.target)):
        if not 0 <= end < count:
            return f".{name}: must be 0..{count - 1}, got {end}"
    if brain.neurons[edge.target].layer == "input":
        return f".target: must not be an input, got neuron {edge.target}"
    if not math.isfinite(edge.weight):
        return f".weight: must be finite, got {edge.weight}"
    return ""
