"""Random genomes, and the random parts, neurons and connections that mutation adds.

Source: Hupkes 2016, section 4.4.2; the code of the original. Two of its errors are
avoided: no robot has fewer parts than the experiment allows, and every part has its own
identity beside the common colour.
"""

from collections.abc import Iterable, Iterator, Sequence

import numpy as np

from coordinator.evolution.mutable_genome import (
    MutableGenome,
    SizeCounts,
    gene_ids,
    level,
    path_between,
    preorder,
    size_of,
    to_genome,
)
from coordinator.evolution.random_streams import BufferedRng
from schema.errors import ExperimentError
from schema.experiment.document import Experiment, Space, body_space
from schema.parts import COLOURS, BodySpace, PartType
from schema.robot.brain import NEURON_TYPES, Layer
from schema.robot.genome import ConnectionGene, Genome, NeuronGene
from schema.robot.ids import BirthId
from schema.robot.robot import ORIENTATIONS

Place = tuple[MutableGenome, int]
"""A branch and one of its slots."""
Endpoint = tuple[MutableGenome, tuple[Layer, int]]
"""One end of a connection: a branch and one of its neurons."""

_NEURONS = tuple(NEURON_TYPES.items())

FIRST = BirthId(0, 0)
MAX_TREES = 10_000
"""Number of trees without a motor, or too small, before `generate` fails."""


def generate(
    rng: np.random.Generator, experiment: Experiment, birth: BirthId = FIRST
) -> Genome:
    """Return a random genome: at least one motor, within all restrictions.

    The analyzer checks later whether its parts intersect.

    Args:
        rng: the stream to draw from.
        experiment: body space, restrictions, probabilities.
        birth: id of the individual; the identities of its parts derive from it.

    Raises:
        ExperimentError: no random tree meets the restrictions.
    """
    draws = BufferedRng(rng)
    least = experiment.space.min_parts
    for _ in range(MAX_TREES):
        root = _random_body(draws, experiment, gene_ids(birth))
        branches = preorder(root)
        size = size_of(branches)
        if size.outputs and size.parts >= least:
            _add_brain(draws, branches, experiment)
            if experiment.space.planar:
                level(branches)
            return to_genome(branches)
    raise ExperimentError(
        f"space: {MAX_TREES} random trees had no motor or fewer than "
        f"space.min_parts = {least} parts: the restrictions and "
        f"part types {experiment.space.part_types} allow (nearly) no robot"
    )


def _random_body(
    draws: BufferedRng, experiment: Experiment, genes: Iterator[int]
) -> MutableGenome:
    """Return a random tree without hidden neurons, possibly without a motor."""
    space, shape = experiment.space, experiment.generation
    types = body_space(space)
    drawn = int(draws.normal(shape.parts_mean, shape.parts_sd))
    target = min(max(drawn, space.min_parts), space.max_parts)
    core = next(kind for kind in types.values() if kind.is_root)
    root = random_part(draws, core, genes)
    colour = root.parameters[-len(COLOURS) :]
    size = size_of([root])
    places: list[Place] = [(root, slot) for slot in range(core.arity)]
    while size.parts < target:
        growth = pick_growth(draws, places, usable_types(types, size, space))
        if growth is None:
            break
        (parent, slot), kind = growth
        part = random_part(draws, kind, genes, colour)
        parent.graft(part, slot)
        size = size.plus(size_of([part]))
        places.extend((part, free) for free in part.free_slots())
    return root


def _add_brain(
    draws: BufferedRng, branches: Sequence[MutableGenome], experiment: Experiment
) -> None:
    """Add hidden neurons to a tree, and connections among all neurons."""
    hosts = branches
    if experiment.generation.hidden_on == "wired":
        hosts = [b for b in branches if b.kind.inputs or b.outputs]
    for _ in range(draws.below(experiment.space.max_hidden + 1)):
        draws.pick(hosts).hidden += (random_neuron(draws),)
    wire(draws, branches, branches, experiment.generation.p_connect_neurons)


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
        genes: source of identities; the part gets the next one.
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
    sources: Iterable[MutableGenome],
    targets: Iterable[MutableGenome],
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
