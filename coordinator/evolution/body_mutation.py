"""The steps of mutation that change the body; `variation` orders them.

Each changes a tree in place and keeps every restriction. Source: Hupkes 2016,
section 4.4.6; facts of the original, section 4.5. Its traps are avoided: a new part
may connect to every neuron, and the mean size of what could be duplicated is a mean.
"""

from collections.abc import Iterable, Iterator
from fractions import Fraction
from math import ceil

from coordinator.evolution.growth import (
    endings,
    half_up,
    pick_growth,
    random_neuron,
    random_part,
    usable_types,
    wire,
)
from coordinator.evolution.mutable_genome import (
    MutableGenome,
    copied,
    free_places,
    lineage,
    preorder,
)
from coordinator.evolution.random_streams import BufferedRng
from coordinator.evolution.size_counts import SizeCounts, greatest, tallies, tally
from schema.experiment.document import Experiment, Space, body_space


def deletable(
    sizes: dict[MutableGenome, SizeCounts], space: Space
) -> list[MutableGenome]:
    """Return the subtrees without which a tree keeps the least number of parts."""
    total = next(iter(sizes.values()))
    return [
        branch
        for branch, size in sizes.items()
        if branch.parent and total.parts - size.parts >= space.min_parts
    ]


def duplicable(
    sizes: dict[MutableGenome, SizeCounts], space: Space
) -> list[MutableGenome]:
    """Return the subtrees of which a tree may hold one more."""
    room = greatest(space).plus(next(iter(sizes.values())), -1)
    return [
        branch for branch, size in sizes.items() if branch.parent and size.fits(room)
    ]


def delete_subtree(
    draws: BufferedRng, root: MutableGenome, experiment: Experiment
) -> None:
    """Delete a random subtree, with the experiment's probability."""
    if not draws.chance(experiment.variation.p_delete_subtree):
        return
    if candidates := deletable(tallies(preorder(root)), experiment.space):
        draws.pick(candidates).cut()


def duplicate_subtree(
    draws: BufferedRng, root: MutableGenome, experiment: Experiment
) -> None:
    """Put a copy of a random subtree on a free slot, with a probability."""
    if not draws.chance(experiment.variation.p_duplicate_subtree):
        return
    branches = preorder(root)
    candidates = duplicable(tallies(branches), experiment.space)
    places = free_places(branches)
    if candidates and places:
        twin = copied(draws.pick(candidates))
        parent, slot = draws.pick(places)
        parent.graft(twin, slot)


def swap_subtrees(
    draws: BufferedRng, root: MutableGenome, experiment: Experiment
) -> None:
    """Let two subtrees, neither within the other, change places, by chance."""
    if not draws.chance(experiment.variation.p_swap_subtree):
        return
    others = preorder(root)[1:]
    if not others:
        return
    first = draws.pick(others)
    above = lineage(first)
    candidates = [b for b in others if b not in above and first not in lineage(b)]
    if candidates:
        second = draws.pick(candidates)
        (one, at), (other, there) = _seat(first), _seat(second)
        one.graft(second, at)
        other.graft(first, there)


def _seat(branch: MutableGenome) -> tuple[MutableGenome, int]:
    assert branch.parent is not None
    return branch.parent, branch.parent_slot


def vary_parts(
    draws: BufferedRng, branches: Iterable[MutableGenome], epsilon: float
) -> None:
    """Move every part's parameters, but for its colour, towards random values."""
    for branch in branches:
        if branch.kind.own_parameters:
            branch.parameters = draws.nearby(
                branch.kind.parameters, branch.parameters, epsilon
            )


def expected_parts(root: MutableGenome, experiment: Experiment) -> float:
    """Return how many parts to add on average; 0 or less is none.

    What deletion takes on average, less what duplication gives, but no more than
    there is room for.
    """
    variation, space = experiment.variation, experiment.space
    sizes = tallies(preorder(root))
    gone = [sizes[branch].parts for branch in deletable(sizes, space)]
    doubled = [sizes[branch].parts for branch in duplicable(sizes, space)]
    more = float(sum(doubled))
    if doubled and variation.duplicable_size == "mean":
        more /= len(doubled)
    less = sum(gone) / len(gone) if gone else 0.0
    return min(
        variation.p_delete_subtree * less - variation.p_duplicate_subtree * more,
        space.max_parts - sizes[root].parts,
    )


def add_parts(
    draws: BufferedRng,
    root: MutableGenome,
    genes: Iterator[int],
    experiment: Experiment,
) -> None:
    """Add random parts, `expected_parts` on average, each with its share of brain."""
    expected = expected_parts(root, experiment)
    if expected <= 0.0:
        return
    reevaluations = (
        ceil(2.0 * expected) if experiment.variation.add_parts == "loop" else 1
    )
    for _ in range(reevaluations):
        if draws.chance(expected / reevaluations):
            _add_part(draws, root, genes, experiment)


def _add_part(
    draws: BufferedRng,
    root: MutableGenome,
    genes: Iterator[int],
    experiment: Experiment,
) -> None:
    space = experiment.space
    branches = preorder(root)
    size = tally(branches)
    usable = usable_types(body_space(space), size, space)
    growth = pick_growth(draws, free_places(branches), usable)
    if growth is None:
        return
    (parent, slot), kind = growth
    part = random_part(draws, kind, genes)
    share = half_up(Fraction(draws.below(space.max_hidden + 1), size.parts))
    part.hidden = tuple(
        random_neuron(draws) for _ in range(min(share, space.max_hidden - size.hidden))
    )
    parent.graft(part, slot)
    wire(
        draws,
        endings([part], "input", "output", "hidden"),
        endings(preorder(root), "output", "hidden"),
        experiment.generation.p_connect_neurons,
    )
