"""Random robots: the founders, and the whole of the no-reproduction baseline.

Source: Hupkes 2016, section 4.4.2; facts of the original, section 4.3. Two traps
are avoided: an experiment's least number of parts is kept, not only aimed at, and
every part has an identity of its own beside the colour that it shares.
"""

from collections.abc import Iterator, Sequence

import numpy as np

from coordinator.evolution.growth import (
    Place,
    endings,
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
    to_genome,
)
from coordinator.evolution.random_streams import BufferedRng
from coordinator.evolution.size_counts import SizeCounts, tally
from schema.errors import ExperimentError
from schema.experiment.document import Experiment, body_space
from schema.parts import COLOURS
from schema.robot.genome import Genome
from schema.robot.ids import BirthId

FIRST = BirthId(0, 0)
MAX_TREES = 10_000
"""Trees without a motor, or too small, before a document is called impossible."""


def generate(
    rng: np.random.Generator, experiment: Experiment, birth: BirthId = FIRST
) -> Genome:
    """Return a random genome: at least one motor, within all restrictions.

    Whether its parts intersect is the analyzer's question, not this one's.

    Args:
        rng: the stream to draw from.
        experiment: body space, restrictions, probabilities.
        birth: whose it is; its parts' identities are made of it.

    Raises:
        ExperimentError: restrictions that no random tree meets.
    """
    draws = BufferedRng(rng)
    least = experiment.space.min_parts
    for _ in range(MAX_TREES):
        root = _random_body(draws, experiment, gene_ids(birth))
        branches = preorder(root)
        size = tally(branches)
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
    """Return a random tree without hidden neurons; it may lack a motor."""
    space, shape = experiment.space, experiment.generation
    types = body_space(space)
    drawn = int(draws.normal(shape.parts_mean, shape.parts_sd))
    target = min(max(drawn, space.min_parts), space.max_parts)
    core = next(kind for kind in types.values() if kind.is_root)
    root = random_part(draws, core, genes)
    colour = root.parameters[-len(COLOURS) :]
    size = SizeCounts(1, core.inputs, core.outputs, 0)
    places: list[Place] = [(root, slot) for slot in range(core.arity)]
    while size.parts < target:
        growth = pick_growth(draws, places, usable_types(types, size, space))
        if growth is None:
            break
        (parent, slot), kind = growth
        part = random_part(draws, kind, genes, colour)
        parent.graft(part, slot)
        size = size.plus(SizeCounts(1, kind.inputs, kind.outputs, 0))
        places.extend((part, free) for free in part.free_slots())
    return root


def _add_brain(
    draws: BufferedRng, branches: Sequence[MutableGenome], experiment: Experiment
) -> None:
    """Give a tree its hidden neurons, and connections among all neurons."""
    hosts = branches
    if experiment.generation.hidden_on == "wired":
        hosts = [b for b in branches if b.kind.inputs or b.outputs]
    for _ in range(draws.below(experiment.space.max_hidden + 1)):
        draws.pick(hosts).hidden += (random_neuron(draws),)
    wire(
        draws,
        endings(branches, "input", "output", "hidden"),
        endings(branches, "output", "hidden"),
        experiment.generation.p_connect_neurons,
    )
