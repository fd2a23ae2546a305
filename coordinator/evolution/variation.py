"""How two parents make a child: crossover, mutation, and what is refused.

Source: Hupkes 2016, sections 4.4.3 to 4.4.6; facts of the original, sections 4.4 to
4.6. The analyzer's verdict, which ends a mating attempt, is asked for elsewhere.
"""

from collections.abc import Iterable, Iterator

import numpy as np

from coordinator.evolution.body_mutation import (
    add_parts,
    delete_subtree,
    duplicate_subtree,
    swap_subtrees,
    vary_parts,
)
from coordinator.evolution.brain_mutation import (
    add_connections,
    add_hidden_neurons,
    delete_connections,
    delete_hidden_neurons,
    vary_neurons,
)
from coordinator.evolution.mutable_genome import (
    MutableGenome,
    gene_ids,
    level,
    preorder,
    to_genome,
    to_mutable,
)
from coordinator.evolution.random_streams import BufferedRng
from coordinator.evolution.size_counts import greatest, tallies, tally
from schema.experiment.document import Experiment, body_space
from schema.robot.genome import Genome
from schema.robot.ids import BirthId


def mate(
    first: Genome,
    second: Genome,
    rng: np.random.Generator,
    experiment: Experiment,
    birth: BirthId,
) -> Genome | None:
    """Return a child of two parents, or None where this attempt comes to none.

    Args:
        first: gives the child its root.
        second: gives a subtree.
        rng: the stream of this attempt.
        experiment: body space, restrictions, probabilities.
        birth: whose genome it is to be; its new parts' identities are made of it.

    Returns:
        A genome within all restrictions, planar where bodies are, with at least
        one motor; None if crossover finds no fitting subtree or no motor is left.
    """
    draws = BufferedRng(rng)
    types = body_space(experiment.space)
    root, donor = to_mutable(first, types), to_mutable(second, types)
    thawed = [*preorder(root), *preorder(donor)]
    child: Genome | None = None
    if crossover(draws, root, donor, experiment):
        mutate(draws, root, gene_ids(birth), experiment)
        branches = preorder(root)
        if any(branch.outputs for branch in branches):
            if experiment.space.planar:
                level(branches)
            child = to_genome(branches)
        _let_go(branches)
    _let_go(thawed)
    return child


def _let_go(branches: Iterable[MutableGenome]) -> None:
    """Free branches at once, with whatever was cut off them.

    Parents and children name each other: they would wait for the garbage collector,
    which was a twentieth of the coordinator's time.
    """
    for branch in branches:
        branch.parent = None


def crossover(
    draws: BufferedRng,
    root: MutableGenome,
    donor: MutableGenome,
    experiment: Experiment,
) -> bool:
    """Put a subtree of a donor in the place of one of a tree, neither a root.

    The subtree that goes is uniform; the one that comes is uniform among those with
    which the tree stays within its limits. It keeps its own slot and turn.

    Args:
        draws: where the choices come from.
        root: the tree that changes.
        donor: the other; what is taken is cut off it.
        experiment: restrictions.

    Returns:
        Whether it was done; if not, the trees are as they were.
    """
    space = experiment.space
    branches, gifts = preorder(root), tallies(preorder(donor))
    if len(branches) == 1:
        return False
    gone = draws.pick(branches[1:])
    rest = tally(branches).plus(tally(preorder(gone)), -1)
    room = greatest(space).plus(rest, -1)
    candidates = [
        branch for branch, size in gifts.items() if branch.parent and size.fits(room)
    ]
    if not candidates:
        return False
    gift = draws.pick(candidates)
    parts = rest.parts + gifts[gift].parts
    if experiment.variation.check_min_parts and parts < space.min_parts:
        return False
    assert gone.parent is not None
    gift.cut()
    gone.parent.graft(gift, gone.parent_slot)
    return True


def mutate(
    draws: BufferedRng,
    root: MutableGenome,
    genes: Iterator[int],
    experiment: Experiment,
) -> None:
    """Change a tree in place, step by step in the order of the thesis.

    Args:
        draws: where all choices come from.
        root: the tree.
        genes: identities for parts that are added.
        experiment: restrictions and probabilities.
    """
    variation = experiment.variation
    delete_subtree(draws, root, experiment)
    duplicate_subtree(draws, root, experiment)
    swap_subtrees(draws, root, experiment)
    branches = preorder(root)
    hidden = sum(len(branch.hidden) for branch in branches)
    connections = sum(len(branch.connections) for branch in branches)
    delete_hidden_neurons(draws, branches, variation.p_delete_hidden_neuron)
    delete_connections(draws, branches, variation.p_remove_brain_connection)
    vary_parts(draws, branches, variation.body_epsilon)
    vary_neurons(draws, branches, variation.brain_epsilon)
    add_hidden_neurons(draws, branches, hidden, experiment)
    add_connections(draws, branches, connections, experiment)
    add_parts(draws, root, genes, experiment)
