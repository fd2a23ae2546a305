"""What generation and mutation add to a tree: parts, neurons, connections.

Source: facts of the original, sections 4.3 and 4.5.
"""

from collections.abc import Iterable, Iterator
from fractions import Fraction

from coordinator.evolution.mutable_genome import MutableGenome, path_between
from coordinator.evolution.random_streams import BufferedRng
from coordinator.evolution.size_counts import SizeCounts
from schema.experiment.document import Space
from schema.parts import COLOURS, BodySpace, PartType
from schema.robot.brain import NEURON_TYPES, Layer
from schema.robot.genome import ConnectionGene, NeuronGene
from schema.robot.robot import ORIENTATIONS

Place = tuple[MutableGenome, int]
Ending = tuple[MutableGenome, tuple[Layer, int]]
"""One end of a connection: a branch and a neuron of it."""

_NEURONS = tuple(NEURON_TYPES.items())


def half_up(number: Fraction) -> int:
    """Return the nearest integer, the upper one of two: the original's rounding."""
    return int(number + Fraction(1, 2))


def random_neuron(draws: BufferedRng) -> NeuronGene:
    """Return an output or hidden neuron of uniform type, uniform parameters."""
    kind, parameters = draws.pick(_NEURONS)
    return NeuronGene(kind, draws.values(parameters))


def random_part(
    draws: BufferedRng,
    kind: PartType,
    genes: Iterator[int],
    colour: tuple[float, ...] = (),
) -> MutableGenome:
    """Return a part that hangs nowhere yet, without hidden neurons.

    Args:
        draws: where its slot, turn, parameters and neurons come from.
        kind: its type; a root gets no slot and no turn.
        genes: the next of them becomes its identity.
        colour: red, green, blue; empty for random ones.
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
    """Return the part types that a tree of some size may still take."""
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
    """Return a free place and a type to put there, or None if nothing fits.

    The place is uniform among those that some type fits, the type uniform among
    those that fit the place. The place is taken out of ``places``, as is any that
    nothing fits: as a tree grows, what is usable only becomes less.
    """
    while places and usable:
        place = places.pop(draws.below(len(places)))
        under = place[0].kind.name
        if fitting := [kind for kind in usable if under not in kind.not_on]:
            return place, draws.pick(fitting)
    return None


def endings(branches: Iterable[MutableGenome], *layers: Layer) -> list[Ending]:
    """Return the neurons of some layers that connections may end or begin at."""
    return [(branch, end) for branch in branches for end in branch.neurons(*layers)]


def connect(draws: BufferedRng, source: Ending, target: Ending) -> ConnectionGene:
    """Return a connection of random weight with the path that leads there."""
    path = path_between(source[0], target[0])
    return ConnectionGene(source[1], path, target[1], draws.number())


def wire(
    draws: BufferedRng, sources: list[Ending], targets: list[Ending], probability: float
) -> None:
    """Add each connection of the full product with a probability."""
    for source in sources:
        branch = source[0]
        made = tuple(
            connect(draws, source, target)
            for target in targets
            if draws.number() < probability
        )
        branch.connections += made
