"""Random parts, neurons and connections, for generation and mutation.

Source: facts of the original, sections 4.3 and 4.5.
"""

from collections.abc import Iterable, Iterator

from coordinator.evolution.mutable_genome import (
    MutableGenome,
    SizeCounts,
    path_between,
)
from coordinator.evolution.random_streams import BufferedRng
from schema.experiment.document import Space
from schema.parts import COLOURS, BodySpace, PartType
from schema.robot.brain import NEURON_TYPES, Layer
from schema.robot.genome import ConnectionGene, NeuronGene
from schema.robot.robot import ORIENTATIONS

Place = tuple[MutableGenome, int]
"""A branch and one of its slots."""
Endpoint = tuple[MutableGenome, tuple[Layer, int]]
"""One end of a connection: a branch and one of its neurons."""

_NEURONS = tuple(NEURON_TYPES.items())


def random_neuron(draws: BufferedRng) -> NeuronGene:
    """Return an output or hidden neuron of uniform type with uniform parameters."""
    kind, parameters = draws.pick(_NEURONS)
    return NeuronGene(kind, draws.values(parameters))


def random_part(
    draws: BufferedRng,
    kind: PartType,
    genes: Iterator[int],
    colour: tuple[float, ...] = (),
) -> MutableGenome:
    """Return a detached part without hidden neurons.

    Args:
        draws: source of its slot, orientation, parameters and neurons.
        kind: its type; a root gets no slot and no orientation.
        genes: the next of them becomes its identity.
        colour: red, green, blue; empty for a random colour.
    """
    return MutableGenome(
        kind,
        -1 if kind.is_root else draws.below(kind.arity),
        0 if kind.is_root else draws.pick(ORIENTATIONS),
        draws.values(kind.own_parameters) + (colour or draws.values(COLOURS)),
        next(genes),
        tuple(random_neuron(draws) for _ in range(kind.outputs)),
    )


def usable_types(types: BodySpace, size: SizeCounts, space: Space) -> list[PartType]:
    """Return the part types that fit a tree of some size within all limits."""
    return [
        kind
        for kind in types.values()
        if not kind.is_root
        and size.parts < space.max_parts
        and size.inputs + kind.inputs <= space.max_inputs
        and size.outputs + kind.outputs <= space.max_outputs
    ]


def pick_growth(
    draws: BufferedRng, places: list[Place], usable: list[PartType]
) -> tuple[Place, PartType] | None:
    """Return a free place and a type for it, or None if nothing fits.

    The place is uniform among those that some type fits, the type uniform among
    those that fit the place. The place is removed from ``places``, as is every place
    that no type fits: a growing tree never makes more types usable.
    """
    while places and usable:
        place = places.pop(draws.below(len(places)))
        parent = place[0].kind.name
        if fitting := [kind for kind in usable if parent not in kind.not_on]:
            return place, draws.pick(fitting)
    return None


def endpoints(branches: Iterable[MutableGenome], *layers: Layer) -> list[Endpoint]:
    """Return all neurons of some layers as ends of connections."""
    return [(branch, end) for branch in branches for end in branch.neurons(*layers)]


def connect(draws: BufferedRng, source: Endpoint, target: Endpoint) -> ConnectionGene:
    """Return a connection of random weight from one neuron to another."""
    path = path_between(source[0], target[0])
    return ConnectionGene(source[1], path, target[1], draws.number())


def wire(
    draws: BufferedRng,
    sources: list[Endpoint],
    targets: list[Endpoint],
    probability: float,
) -> None:
    """Add each connection of the full product with a probability."""
    for source in sources:
        source[0].connections += tuple(
            connect(draws, source, target)
            for target in targets
            if draws.chance(probability)
        )
