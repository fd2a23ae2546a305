"""Mutation of the body, step by step; `variation` calls the steps in order.

Each step changes a tree in place and keeps every restriction. Source: Hupkes 2016,
section 4.4.6; the code of the original. Two of its errors are avoided: a new part may
connect to every neuron, and the mean size of the subtrees that can be duplicated is a
mean.
"""

from collections.abc import Iterable, Iterator, Sequence
from math import ceil

from coordinator.evolution.brains import brain_genes, brain_rules
from coordinator.evolution.generation import pick_growth, random_part, usable_types
from coordinator.evolution.mutable_genome import (
    Counts,
    MutableGenome,
    copied,
    fitting_subtrees,
    free_places,
    lineage,
    preorder,
    size_limits,
    size_of,
    subtree_sizes,
)
from coordinator.evolution.random_streams import BufferedRng
from schema.experiment.document import Experiment, Space, body_space


def deletable(sizes: dict[MutableGenome, Counts], space: Space) -> list[MutableGenome]:
    """Return the subtrees that can be deleted without falling below the least size."""
    most = next(iter(sizes.values()))[0] - space.min_parts
    return [
        branch
        for branch, (parts, *_) in sizes.items()
        if branch.parent and parts <= most
    ]


def duplicable(sizes: dict[MutableGenome, Counts], space: Space) -> list[MutableGenome]:
    """Return the subtrees of which a second copy stays within all limits."""
    total = next(iter(sizes.values()))
    return fitting_subtrees(sizes, size_limits(space).minus(total))


def delete_subtree(
    draws: BufferedRng, root: MutableGenome, experiment: Experiment
) -> None:
    """Delete a random subtree, with the probability of the experiment."""
    if not draws.chance(experiment.variation.p_delete_subtree):
        return
    if candidates := deletable(subtree_sizes(preorder(root)), experiment.space):
        draws.pick(candidates).cut()


def duplicate_subtree(
    draws: BufferedRng, root: MutableGenome, experiment: Experiment
) -> None:
    """Attach a copy of a random subtree to a free slot, with a probability."""
    if not draws.chance(experiment.variation.p_duplicate_subtree):
        return
    branches = preorder(root)
    candidates = duplicable(subtree_sizes(branches), experiment.space)
    places = free_places(branches)
    if candidates and places:
        copy = copied(draws.pick(candidates))
        parent, slot = draws.pick(places)
        parent.graft(copy, slot)


def swap_subtrees(
    draws: BufferedRng, root: MutableGenome, experiment: Experiment
) -> None:
    """Exchange two subtrees, neither within the other, with a probability."""
    if not draws.chance(experiment.variation.p_swap_subtree):
        return
    others = preorder(root)[1:]
    if not others:
        return
    first = draws.pick(others)
    ancestors = lineage(first)
    candidates = [b for b in others if b not in ancestors and first not in lineage(b)]
    if candidates:
        second = draws.pick(candidates)
        one, slot = first.parent, first.parent_slot
        other, other_slot = second.parent, second.parent_slot
        assert one is not None
        assert other is not None
        one.graft(second, slot)
        other.graft(first, other_slot)


def vary_parts(
    draws: BufferedRng, branches: Iterable[MutableGenome], epsilon: float
) -> None:
    """Move the parameters of every part, except its colour, towards random values."""
    for branch in branches:
        if branch.kind.own_parameters:
            branch.parameters = draws.nearby(
                branch.kind.parameters, branch.parameters, epsilon
            )


def expected_parts(branches: Sequence[MutableGenome], experiment: Experiment) -> float:
    """Return the mean number of parts to add; 0 or less means none.

    It is the mean number that deletion removes less the mean number that duplication
    adds, limited by the room that is left.

    Args:
        branches: those of the tree, depth first.
        experiment: restrictions and probabilities.
    """
    variation, space = experiment.variation, experiment.space
    sizes = subtree_sizes(branches)
    deleted = [sizes[branch][0] for branch in deletable(sizes, space)]
    duplicated = [sizes[branch][0] for branch in duplicable(sizes, space)]
    more = float(sum(duplicated))
    if duplicated and variation.duplicable_size == "mean":
        more /= len(duplicated)
    less = sum(deleted) / len(deleted) if deleted else 0.0
    return min(
        variation.p_delete_subtree * less - variation.p_duplicate_subtree * more,
        space.max_parts - len(branches),
    )


def add_parts(
    draws: BufferedRng,
    branches: Sequence[MutableGenome],
    genes: Iterator[int],
    experiment: Experiment,
) -> None:
    """Add random parts, `expected_parts` on average, with neurons and connections.

    Args:
        draws: source of all choices.
        branches: those of the tree, depth first.
        genes: identities of the parts.
        experiment: restrictions and probabilities.
    """
    expected = expected_parts(branches, experiment)
    if expected <= 0.0:
        return
    trials = ceil(2.0 * expected) if experiment.variation.add_parts == "loop" else 1
    for _ in range(trials):
        if draws.chance(expected / trials):
            _add_part(draws, branches[0], genes, experiment)


def _add_part(
    draws: BufferedRng,
    root: MutableGenome,
    genes: Iterator[int],
    experiment: Experiment,
) -> None:
    space = experiment.space
    branches = preorder(root)
    size = size_of(branches)
    usable = usable_types(body_space(space), size, space)
    growth = pick_growth(draws, free_places(branches), usable)
    if growth is None:
        return
    (parent, slot), kind = growth
    brain = brain_genes(experiment)
    part = random_part(draws, kind, genes, brain)
    parent.graft(part, slot)
    brain.grow(draws, [part], preorder(root), brain_rules(experiment))
