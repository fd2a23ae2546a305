"""Random genomes: founders, and all robots of the no-reproduction baseline.

Source: Hupkes 2016, section 4.4.2; facts of the original, section 4.3. Two errors of
the original are avoided: no robot has fewer parts than the experiment allows, and
every part has its own identity beside the common colour.
"""

from collections.abc import Iterator, Sequence

import numpy as np

from coordinator.evolution.growth import (
    Place,
    endpoints,
    pick_growth,
    random_neuron,
    random_part,
    usable_types,
    wire,
)
from coordinator.evolution.mutable_genome import (
    MutableGenome,
    gene_ids,
    level,
    preorder,
    size_of,
    to_genome,
)
from coordinator.evolution.random_streams import BufferedRng
from schema.errors import ExperimentError
from schema.experiment.document import Experiment, body_space
from schema.parts import COLOURS
from schema.robot.genome import Genome
from schema.robot.ids import BirthId

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
    wire(
        draws,
        endpoints(branches, "input", "output", "hidden"),
        endpoints(branches, "output", "hidden"),
        experiment.generation.p_connect_neurons,
    )
