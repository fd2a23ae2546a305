"""Revolve Angle, the encoding of the thesis: the genome is the tree of parts itself.

Each step of mutation changes a mutable tree in place and keeps every restriction; those
of the brain belong to its type. The analyzer checks the body of a child later.
Source: Hupkes 2016, sections 4.4.3 to 4.4.6; the code of the original. Two of its
errors are avoided: a new part may connect to every neuron, and the mean size of the
subtrees that can be duplicated is a mean.
"""

from collections.abc import Iterable, Iterator, Sequence
from math import ceil
from typing import NamedTuple

import numpy as np

from coordinator.evolution.brains import brain_genes, brain_rules
from coordinator.evolution.generation import (
    generate,
    pick_growth,
    random_part,
    usable_types,
)
from coordinator.evolution.mutable_genome import (
    Counts,
    MutableGenome,
    copied,
    fitting_subtrees,
    free_places,
    gene_ids,
    level,
    lineage,
    preorder,
    size_limits,
    size_of,
    subtree_sizes,
    to_branches,
    to_genome,
    to_mutable,
)
from coordinator.evolution.random_streams import BufferedRng
from schema.errors import InvalidRobot
from schema.experiment.document import Experiment, Space, body_space
from schema.parts import BodySpace
from schema.robot.genome import Genome, Node, develop, walk
from schema.robot.ids import BirthId
from schema.robot.inverse_development import genome_of
from schema.robot.robot import Robot
from schema.wire.genome_bytes import encode_genome
from schema.wire.protobuf import decode_genome

_MOST_DONORS = 1024


class Donor(NamedTuple):
    """Parent that gives a subtree.

    Attributes:
        nodes: of its genome, depth first.
        sizes: of the subtree of each node.
    """

    nodes: Sequence[Node]
    sizes: Sequence[Counts]
    types: BodySpace


class RevolveAngle:
    """Encoding by trees of parts; a plug-in of the kind ``encoding.type``.

    The sections ``[generation]`` and ``[variation]`` are its parameters.
    """

    def __init__(
        self, experiment: Experiment, types: BodySpace, _parameters: None
    ) -> None:
        self._experiment = experiment
        self._types = types
        self._brain, self._rules = brain_genes(experiment), brain_rules(experiment)
        self._donors: dict[int, Donor] = {}

    def random(self, rng: np.random.Generator, birth: BirthId) -> Genome:
        """Return a random genome with at least one motor, as ``generate``."""
        return generate(rng, self._experiment, birth)

    def develop(self, genome: Genome) -> Robot:
        """Return the robot that a genome describes."""
        return develop(genome, self._types)

    def mate(
        self, first: Genome, second: Genome, rng: np.random.Generator, birth: BirthId
    ) -> Genome | None:
        """Return the genome of a child: crossover and mutation of one mutable tree.

        The first parent gives the root, the second a subtree; the identities of new
        parts derive from the child's birth id. It is within all restrictions, planar
        where the experiment says so, with at least one motor; None if crossover finds
        no fitting subtree or no motor is left.
        """
        draws = BufferedRng(rng)
        branches, donor = to_branches(first, self._types), self._donor(second)
        child: Genome | None = None
        if crossover(draws, branches, donor, self._experiment):
            child = self._mutated(draws, branches[0], birth)
        _unlink(branches)
        return child

    def crossover(
        self, first: Genome, second: Genome, rng: np.random.Generator
    ) -> Genome | None:
        """Return the first genome with a subtree of the second, or None."""
        branches, donor = to_branches(first, self._types), self._donor(second)
        is_done = crossover(BufferedRng(rng), branches, donor, self._experiment)
        return self._genome(preorder(branches[0])) if is_done else None

    def mutate(
        self, genome: Genome, rng: np.random.Generator, birth: BirthId
    ) -> Genome | None:
        """Return a mutated genome, or None if no motor is left."""
        root = to_mutable(genome, self._types)
        return self._mutated(BufferedRng(rng), root, birth)

    def to_bytes(self, genome: Genome) -> bytes:
        """Return the Protobuf bytes of a genome."""
        return encode_genome(genome)

    def from_bytes(self, data: bytes) -> Genome:
        """Return the genome of Protobuf bytes.

        Raises:
            MalformedMessage: other bytes.
            InvalidRobot: a part type that the experiment does not have.
        """
        genome = decode_genome(data)
        for node, _, _ in walk(genome):
            if node.kind not in self._types:
                raise InvalidRobot(
                    f"genome: part types are {', '.join(self._types)}, "
                    f"got {node.kind!r}"
                )
        return genome

    def from_robot(self, robot: Robot) -> Genome:
        """Return the genome that develops into a robot."""
        return genome_of(robot)

    def _donor(self, genome: Genome) -> Donor:
        """Return the subtrees of a genome; those of recent parents are kept."""
        known = self._donors.get(id(genome))
        if known is None:
            if len(self._donors) >= _MOST_DONORS:
                self._donors.clear()
            # It holds the genome, whose id is thus no other's.
            known = self._donors[id(genome)] = donor_of(genome, self._types)
        return known

    def _mutated(
        self, draws: BufferedRng, root: MutableGenome, birth: BirthId
    ) -> Genome | None:
        """Mutate a tree in the order of the thesis; return its genome, if with a motor.

        The tree is of no use afterwards.
        """
        experiment = self._experiment
        delete_subtree(draws, root, experiment)
        duplicate_subtree(draws, root, experiment)
        swap_subtrees(draws, root, experiment)
        branches = preorder(root)
        pruned = self._brain.prune(draws, branches, self._rules)
        vary_parts(draws, branches, experiment.variation.body_epsilon)
        self._brain.vary(draws, branches, self._rules, pruned)
        branches = add_parts(draws, branches, gene_ids(birth), experiment)
        has_motor = any(branch.outputs for branch in branches)
        genome = self._genome(branches) if has_motor else None
        _unlink(branches)
        return genome

    def _genome(self, branches: Sequence[MutableGenome]) -> Genome:
        """Return the genome of a tree, planar where the experiment says so."""
        if self._experiment.space.planar:
            level(branches)
        return to_genome(branches)


def _unlink(branches: Iterable[MutableGenome]) -> None:
    """Break the reference cycles of branches, so that they are freed at once.

    Collecting them as garbage took a twentieth of the coordinator's time.
    """
    for branch in branches:
        branch.parent = None


def donor_of(genome: Genome, types: BodySpace) -> Donor:
    """Return the subtrees of a genome."""
    nodes = [node for node, _, _ in walk(genome)]
    return Donor(nodes, subtree_sizes(to_branches(genome, types)), types)


def crossover(
    draws: BufferedRng,
    branches: Sequence[MutableGenome],
    donor: Donor,
    experiment: Experiment,
) -> bool:
    """Replace a subtree by one of a donor, neither a root; return whether one was.

    The replaced subtree is uniform. The donated one is uniform among those with which
    the tree stays within its limits; it keeps its own slot and orientation.
    """
    space = experiment.space
    if len(branches) == 1:
        return False
    place = 1 + draws.below(len(branches) - 1)
    replaced = branches[place]
    end = place + len(preorder(replaced))
    rest = size_of([*branches[:place], *branches[end:]])
    room = size_limits(space).minus(rest)
    candidates = fitting_subtrees(donor.sizes, room)
    if not candidates:
        return False
    donated = draws.pick(candidates)
    parts = rest.parts + donor.sizes[donated][0]
    if parts < space.min_parts:
        return False
    assert replaced.parent is not None
    subtree = to_mutable(donor.nodes[donated], donor.types)
    replaced.parent.graft(subtree, replaced.parent_slot)
    return True


def delete_subtree(
    draws: BufferedRng, root: MutableGenome, experiment: Experiment
) -> None:
    """Delete a random subtree, with the probability of the experiment."""
    if not draws.chance(experiment.variation.p_delete_subtree):
        return
    branches = preorder(root)
    if candidates := deletable(subtree_sizes(branches), experiment.space):
        branches[draws.pick(candidates)].cut()


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
        copy = copied(branches[draws.pick(candidates)])
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


def add_parts(
    draws: BufferedRng,
    branches: list[MutableGenome],
    genes: Iterator[int],
    experiment: Experiment,
) -> list[MutableGenome]:
    """Return a tree with random parts added, `expected_parts` on average."""
    expected = expected_parts(branches, experiment)
    if expected > 0.0:
        trials = ceil(2.0 * expected)
        for _ in range(trials):
            if draws.chance(expected / trials):
                branches = _add_part(draws, branches, genes, experiment)
    return branches


def _add_part(
    draws: BufferedRng,
    branches: list[MutableGenome],
    genes: Iterator[int],
    experiment: Experiment,
) -> list[MutableGenome]:
    """Add one part, if one fits; return the branches as `add_parts` does."""
    space = experiment.space
    size = size_of(branches)
    usable = usable_types(body_space(space), size, space)
    growth = pick_growth(draws, free_places(branches), usable)
    if growth is None:
        return branches
    (parent, slot), kind = growth
    brain = brain_genes(experiment)
    part = random_part(draws, kind, genes, brain)
    parent.graft(part, slot)
    branches = preorder(branches[0])
    brain.grow(draws, [part], branches, brain_rules(experiment))
    return branches


def expected_parts(branches: Sequence[MutableGenome], experiment: Experiment) -> float:
    """Return the mean number of parts to add; 0 or less means none.

    It is the mean number of parts that deletion removes minus the mean number that
    duplication adds, but at most the number that still fits.
    """
    variation, space = experiment.variation, experiment.space
    sizes = subtree_sizes(branches)
    deleted = [sizes[place][0] for place in deletable(sizes, space)]
    duplicated = [sizes[place][0] for place in duplicable(sizes, space)]
    more = sum(duplicated) / len(duplicated) if duplicated else 0.0
    less = sum(deleted) / len(deleted) if deleted else 0.0
    return min(
        variation.p_delete_subtree * less - variation.p_duplicate_subtree * more,
        space.max_parts - len(branches),
    )


def deletable(sizes: Sequence[Counts], space: Space) -> list[int]:
    """Return the places of the subtrees without which the tree is large enough."""
    most = sizes[0][0] - space.min_parts
    return [place for place, size in enumerate(sizes) if place and size[0] <= most]


def duplicable(sizes: Sequence[Counts], space: Space) -> list[int]:
    """Return the places of the subtrees whose second copy stays within all limits."""
    return fitting_subtrees(sizes, size_limits(space).minus(sizes[0]))
