"""Random neurons and connections of a network.

Source: Hupkes 2016, section 4.4.2; the code of the original.
"""

from collections.abc import Iterable, Sequence
from typing import TypeVar

from schema.parts import Parameter
from schema.plugins.protocols import Branch, Draws
from schema.robot.brain import Layer
from schema.robot.genome import ConnectionGene, NeuronGene

B = TypeVar("B", bound=Branch)

Types = Sequence[tuple[str, tuple[Parameter, ...]]]
"""Names and parameters of neuron types."""


def random_neuron(draws: Draws, types: Types) -> NeuronGene:
    """Return an output or hidden neuron of uniform type with uniform parameters."""
    kind, parameters = draws.pick(types)
    return NeuronGene(kind, draws.values(parameters))


def endpoints(
    branches: Iterable[B], *layers: Layer
) -> list[tuple[B, tuple[Layer, int]]]:
    """Return all neurons of some layers as ends of connections."""
    return [(branch, end) for branch in branches for end in branch.neurons(*layers)]


def connect(
    draws: Draws,
    source: tuple[B, tuple[Layer, int]],
    target: tuple[B, tuple[Layer, int]],
) -> ConnectionGene:
    """Return a connection of random weight from one neuron to another."""
    path = source[0].path_to(target[0])
    return ConnectionGene(source[1], path, target[1], draws.number())


def wire(
    draws: Draws,
    sources: Iterable[B],
    targets: Iterable[B],
    probability: float,
) -> None:
    """Add connections between neurons of branches, each possible with a probability."""
    ends = endpoints(targets, "output", "hidden")
    for source in endpoints(sources, "input", "output", "hidden"):
        source[0].connections += tuple(
            connect(draws, source, target)
            for target in ends
            if draws.chance(probability)
        )
