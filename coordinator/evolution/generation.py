"""Random genomes, random brains, and the random parts that mutation adds.

Source: Hupkes 2016, section 4.4.2; the code of the original. Two of its errors are
avoided: no robot has fewer parts than the experiment allows, and every part has its own
identity beside the common colour.
"""

from collections.abc import Iterator

import numpy as np

from coordinator.evolution.brains import brain_genes, brain_rules
from coordinator.evolution.mutable_genome import (
    MutableGenome,
    SizeCounts,
    gene_ids,
    level,
    preorder,
    size_of,
    to_branches,
    to_genome,
)
from coordinator.evolution.random_streams import BufferedRng
from schema.errors import ExperimentError
from schema.experiment.document import Experiment, Space, body_space
from schema.parts import COLOURS, BodySpace, PartType
from schema.plugins.protocols import BrainGenes
from schema.robot.genome import Genome, develop
from schema.robot.ids import BirthId
from schema.robot.inverse_development import genome_of
from schema.robot.robot import ORIENTATIONS, Robot

Place = tuple[MutableGenome, int]
"""A branch and one of its slots."""

FIRST = BirthId(0, 0)
MAX_TREES = 10_000
"""Number of trees without a motor, or too small, before `generate` fails."""


def generate(
    rng: np.random.Generator, experiment: Experiment, birth: BirthId = FIRST
) -> Genome:
    """Return a random genome: at least one motor, within all restrictions.

    The analyzer checks later whether its parts intersect.

    The identities of its parts derive from its birth id.

    Raises:
        ExperimentError: no random tree meets the restrictions.
    """
    draws = BufferedRng(rng)
    least = experiment.space.min_parts
    brain = brain_genes(experiment)
    for _ in range(MAX_TREES):
        root = _random_body(draws, experiment, gene_ids(birth), brain)
        branches = preorder(root)
        size = size_of(branches)
        if size.outputs and size.parts >= least:
            brain.grow(draws, branches, branches, brain_rules(experiment))
            if experiment.space.planar:
                level(branches)
            return to_genome(branches)
    raise ExperimentError(
        f"space: {MAX_TREES} random trees had no motor or fewer than "
        f"space.min_parts = {least} parts: the restrictions and "
        f"part types {experiment.space.part_types} allow (nearly) no robot"
    )


def random_brain(
    rng: np.random.Generator, robot: Robot, experiment: Experiment
) -> Robot:
    """Return a robot with another brain, drawn as those of random robots.

    Each motor gets a random neuron, then the brain type adds hidden neurons and
    connections. The body stays as it is.
    """
    draws, brain = BufferedRng(rng), brain_genes(experiment)
    types = body_space(experiment.space)
    branches = to_branches(genome_of(Robot(robot.parts)), types)
    for branch in branches:
        branch.outputs = brain.outputs(draws, branch.kind)
    brain.grow(draws, branches, branches, brain_rules(experiment))
    return develop(to_genome(branches), types)


def _random_body(
    draws: BufferedRng, experiment: Experiment, genes: Iterator[int], brain: BrainGenes
) -> MutableGenome:
    """Return a random tree without hidden neurons, possibly without a motor."""
    space, shape = experiment.space, experiment.generation
    types = body_space(space)
    drawn = int(draws.normal(shape.parts_mean, shape.parts_sd))
    target = min(max(drawn, space.min_parts), space.max_parts)
    core = next(kind for kind in types.values() if kind.is_root)
    root = random_part(draws, core, genes, brain)
    colour = root.parameters[-len(COLOURS) :]
    size = size_of([root])
    places: list[Place] = [(root, slot) for slot in range(core.arity)]
    while size.parts < target:
        growth = pick_growth(draws, places, usable_types(types, size, space))
        if growth is None:
            break
        (parent, slot), kind = growth
        part = random_part(draws, kind, genes, brain, colour)
        parent.graft(part, slot)
        size = size.plus(size_of([part]))
        places.extend((part, free) for free in part.free_slots())
    return root


def random_part(
    draws: BufferedRng,
    kind: PartType,
    genes: Iterator[int],
    brain: BrainGenes,
    colour: tuple[float, ...] = (),
) -> MutableGenome:
    """Return a detached part without hidden neurons.

    A root gets no slot and no orientation; an empty colour is a random one.
    """
    return MutableGenome(
        kind,
        -1 if kind.is_root else draws.below(kind.arity),
        0 if kind.is_root else draws.pick(ORIENTATIONS),
        draws.values(kind.own_parameters) + (colour or draws.values(COLOURS)),
        next(genes),
        brain.outputs(draws, kind),
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
