"""Variation: the genome of a child by crossover and mutation.

Source: Hupkes 2016, sections 4.4.3 to 4.4.6; the code of the original. The analyzer
checks the body of the child later.
"""

from collections.abc import Iterable, Iterator, Sequence

import numpy as np

from coordinator.evolution.body_mutation import (
    add_parts,
    delete_subtree,
    duplicate_subtree,
    swap_subtrees,
    vary_parts,
)
from coordinator.evolution.brains import brain_genes, brain_rules
from coordinator.evolution.mutable_genome import (
    MutableGenome,
    fitting_subtrees,
    gene_ids,
    level,
    preorder,
    size_limits,
    size_of,
    subtree_sizes,
    to_branches,
    to_genome,
)
from coordinator.evolution.random_streams import BufferedRng
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
    """Return the genome of a child of two parents, or None if the attempt fails.

    Args:
        first: parent that gives the root.
        second: parent that gives a subtree.
        rng: the stream of this attempt.
        experiment: body space, restrictions, probabilities.
        birth: id of the child; the identities of its new parts derive from it.

    Returns:
        A genome within all restrictions, planar where the experiment says so, with at
        least one motor; None if crossover finds no fitting subtree or no motor is
        left.
    """
    draws = BufferedRng(rng)
    types = body_space(experiment.space)
    branches, donors = to_branches(first, types), to_branches(second, types)
    parents, root = [*branches, *donors], branches[0]
    child: Genome | None = None
    if crossover(draws, branches, donors, experiment):
        mutate(draws, root, gene_ids(birth), experiment)
        branches = preorder(root)
        if any(branch.outputs for branch in branches):
            if experiment.space.planar:
                level(branches)
            child = to_genome(branches)
        _unlink(branches)
    _unlink(parents)
    return child


def _unlink(branches: Iterable[MutableGenome]) -> None:
    """Break the reference cycles of branches, so that they are freed at once.

    Collecting them as garbage took a twentieth of the coordinator's time.
    """
    for branch in branches:
        branch.parent = None


def crossover(
    draws: BufferedRng,
    branches: Sequence[MutableGenome],
    donors: Sequence[MutableGenome],
    experiment: Experiment,
) -> bool:
    """Replace a subtree by one of a donor; neither is a root.

    The replaced subtree is uniform. The donated one is uniform among those with which
    the tree stays within its limits; it keeps its own slot and orientation.

    Args:
        draws: source of all choices.
        branches: those of the tree that changes, depth first.
        donors: those of the other tree, which loses the donated subtree.
        experiment: restrictions.

    Returns:
        Whether a subtree was replaced; if not, the trees are unchanged.
    """
    space = experiment.space
    if len(branches) == 1:
        return False
    donated_sizes = subtree_sizes(donors)
    replaced = draws.pick(branches[1:])
    rest = size_of(branches).minus(size_of(preorder(replaced)))
    room = size_limits(space).minus(rest)
    candidates = fitting_subtrees(donated_sizes, room)
    if not candidates:
        return False
    donated = draws.pick(candidates)
    parts = rest.parts + donated_sizes[donated][0]
    if experiment.variation.check_min_parts and parts < space.min_parts:
        return False
    assert replaced.parent is not None
    donated.cut()
    replaced.parent.graft(donated, replaced.parent_slot)
    return True


def mutate(
    draws: BufferedRng,
    root: MutableGenome,
    genes: Iterator[int],
    experiment: Experiment,
) -> None:
    """Mutate a tree in place, step by step in the order of the thesis.

    Args:
        draws: source of all choices.
        root: root of the tree.
        genes: identities of added parts.
        experiment: restrictions and probabilities.
    """
    brain, rules = brain_genes(experiment), brain_rules(experiment)
    delete_subtree(draws, root, experiment)
    duplicate_subtree(draws, root, experiment)
    swap_subtrees(draws, root, experiment)
    branches = preorder(root)
    pruned = brain.prune(draws, branches, rules)
    vary_parts(draws, branches, experiment.variation.body_epsilon)
    brain.vary(draws, branches, rules, pruned)
    add_parts(draws, branches, genes, experiment)
