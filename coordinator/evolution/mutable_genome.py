"""Mutable tree of a genome, and the sizes of its subtrees.

Generation and variation convert a genome into such a tree, change the tree within one
function call, and convert it into a new genome.
"""

from collections.abc import Iterable, Iterator, Sequence
from functools import lru_cache
from itertools import count
from operator import add
from typing import NamedTuple, TypeVar

from msgspec import Struct, field
from msgspec.structs import replace

from schema.experiment.document import Space
from schema.parts import BodySpace, PartType
from schema.robot.brain import Layer
from schema.robot.genome import ConnectionGene, Genome, NeuronGene, Node, walk
from schema.robot.ids import BirthId

Gene = TypeVar("Gene", NeuronGene, ConnectionGene)


_TUPLES = (tuple, tuple, tuple)


class MutableGenome(Struct, eq=False):
    """Mutable node of a genome; its first fields are those of `Node`.

    Attributes:
        parent: None at the root.
        parent_slot: slot of the parent that it occupies; -1 at the root.
        children: by slot, ascending.
    """

    kind: PartType
    slot: int
    orientation: int
    parameters: tuple[float, ...]
    gene: int
    outputs: tuple[NeuronGene, ...] = ()
    hidden: tuple[NeuronGene, ...] = ()
    connections: tuple[ConnectionGene, ...] = ()
    parent: "MutableGenome | None" = None
    parent_slot: int = -1
    children: "dict[int, MutableGenome]" = field(default_factory=dict)

    def free_slots(self) -> list[int]:
        """Return the slots that are free, ascending."""
        return [
            slot
            for slot in range(self.kind.arity)
            if slot != self.slot and slot not in self.children
        ]

    def graft(self, child: "MutableGenome", slot: int) -> None:
        """Attach a child to a slot; it replaces the child that was there."""
        child.parent, child.parent_slot = self, slot
        self.children = dict(sorted({**self.children, slot: child}.items()))

    def cut(self) -> None:
        """Detach this branch, which must not be a root, from its parent."""
        assert self.parent is not None
        del self.parent.children[self.parent_slot]
        self.parent, self.parent_slot = None, -1

    def neurons(self, *layers: Layer) -> list[tuple[Layer, int]]:
        """Return (layer, offset) of its own neurons, in the order of the layers."""
        counts = self.kind.inputs, len(self.outputs), len(self.hidden)
        return [*_neurons(layers, *counts)]

    def path_to(self, other: "MutableGenome") -> tuple[int, ...]:
        """Return the path of a connection to another branch of its tree."""
        return path_between(self, other)

    def along(self, path: tuple[int, ...]) -> "MutableGenome | None":
        """Return the branch at the end of a path; None if the path does not exist."""
        return follow(self, path)


@lru_cache(maxsize=1024)
def _neurons(
    layers: tuple[Layer, ...], inputs: int, outputs: int, hidden: int
) -> tuple[tuple[Layer, int], ...]:
    counts: dict[Layer, int] = {"input": inputs, "output": outputs, "hidden": hidden}
    return tuple((layer, k) for layer in layers for k in range(counts[layer]))


def gene_ids(birth: BirthId) -> Iterator[int]:
    """Return the gene identities for the new parts of an individual.

    They are unique over a run: 16 bits of island, 32 of birth number and 16 of a
    running index from 1, so that no gene is 0.
    """
    return count((birth.island << 48 | birth.number << 16) + 1)


def to_mutable(genome: Genome, space: BodySpace) -> MutableGenome:
    """Return a genome as a mutable tree."""
    return to_branches(genome, space)[0]


def to_branches(genome: Genome, space: BodySpace) -> list[MutableGenome]:
    """Return the branches of a genome's mutable tree, depth first."""
    branches: list[MutableGenome] = []
    for node, parent, slot in walk(genome):
        above = branches[parent] if parent >= 0 else None
        branch = MutableGenome(
            space[node.kind],
            node.slot,
            node.orientation,
            node.parameters,
            node.gene,
            node.outputs,
            node.hidden,
            node.connections,
            above,
            slot,
        )
        branches.append(branch)
        if above is not None:
            above.children[slot] = branch
    return branches


def to_genome(branches: Sequence[MutableGenome]) -> Genome:
    """Return the genome of a tree whose branches are given depth first."""
    nodes: list[Node] = []
    for branch in reversed(branches):
        outputs, hidden, connections = branch.outputs, branch.hidden, branch.connections
        if (type(outputs), type(hidden), type(connections)) != _TUPLES:
            outputs, hidden = _as_tuple(outputs), _as_tuple(hidden)
            connections = _as_tuple(connections)
        # Backwards: children are made before their parent, the last one first.
        children = [(slot, nodes.pop()) for slot in branch.children]
        node = Node(
            branch.kind.name,
            branch.slot,
            branch.orientation,
            branch.parameters,
            branch.gene,
            outputs,
            hidden,
            connections,
            tuple(children),
        )
        nodes.append(node)
    return nodes[0]


def _as_tuple(genes: tuple[Gene, ...]) -> tuple[Gene, ...]:
    """Return genes as a tuple, as genomes share them; brain types may return a list."""
    if not isinstance(genes, tuple | list):
        raise TypeError(f"genes must be a tuple, got a {type(genes).__name__}")
    return tuple(genes)


def preorder(root: MutableGenome) -> list[MutableGenome]:
    """Return a tree's branches depth first, children by ascending slot."""
    order: list[MutableGenome] = []
    stack = [root]
    while stack:
        branch = stack.pop()
        order.append(branch)
        if children := branch.children:
            stack += reversed(children.values())
    return order


def copied(root: MutableGenome) -> MutableGenome:
    """Return a detached copy of a tree."""
    copy = replace(root, parent=None, parent_slot=-1, children={})
    for slot, child in root.children.items():
        copy.graft(copied(child), slot)
    return copy


def free_places(branches: Iterable[MutableGenome]) -> list[tuple[MutableGenome, int]]:
    """Return every (branch, free slot) of some branches, in their order."""
    return [(branch, slot) for branch in branches for slot in branch.free_slots()]


def lineage(branch: MutableGenome) -> list[MutableGenome]:
    """Return a branch and its ancestors, up to the root."""
    line = [branch]
    while (parent := line[-1].parent) is not None:
        line.append(parent)
    return line


def path_between(source: MutableGenome, target: MutableGenome) -> tuple[int, ...]:
    """Return the slots to follow from one branch to another of its tree."""
    if source is target:
        return ()
    down = {branch: depth for depth, branch in enumerate(lineage(target))}
    path: list[int] = []
    here = source
    while here not in down:
        path.append(here.slot)
        assert here.parent is not None
        here = here.parent
    descent = list(down)[: down[here]]
    return (*path, *(branch.parent_slot for branch in reversed(descent)))


def follow(branch: MutableGenome, path: tuple[int, ...]) -> MutableGenome | None:
    """Return the branch at the end of a path; None if the path does not exist."""
    here: MutableGenome | None = branch
    for slot in path:
        if here is None:
            return None
        here = here.parent if slot == here.slot else here.children.get(slot)
    return here


def level(branches: Iterable[MutableGenome]) -> None:
    """Turn the levelled parts of a tree, given depth first, into its core's plane.

    Turns add up from the core outwards. Every levelled part gets the turn that brings
    the sum back to zero; all other parts keep theirs.

    Source: the code of the original (planarity).
    """
    turns: dict[MutableGenome, int] = {}
    for branch in branches:
        if branch.parent is None:
            branch.orientation = turns[branch] = 0
            continue
        before = turns[branch.parent]
        if branch.kind.is_levelled:
            branch.orientation = (360 - before) % 360
        turns[branch] = (before + branch.orientation) % 360


Counts = tuple[int, int, int, int]
"""Plain ``SizeCounts``; a tree has too many subtrees for the names to be free."""


class SizeCounts(NamedTuple):
    """Numbers of parts, inputs, outputs and hidden neurons of some branches."""

    parts: int
    inputs: int
    outputs: int
    hidden: int

    def plus(self, other: Counts) -> "SizeCounts":
        """Return the sum with other counts."""
        return SizeCounts(*map(add, self, other))

    def minus(self, other: Counts) -> "SizeCounts":
        """Return what is left without other counts."""
        parts, inputs, outputs, hidden = self
        p, i, o, h = other
        return SizeCounts(parts - p, inputs - i, outputs - o, hidden - h)


def size_limits(space: Space) -> SizeCounts:
    """Return the greatest counts that a whole tree may have."""
    return SizeCounts(
        space.max_parts, space.max_inputs, space.max_outputs, space.max_hidden
    )


def size_of(branches: Iterable[MutableGenome]) -> SizeCounts:
    """Return the counts of some branches, without their children."""
    parts = inputs = outputs = hidden = 0
    for branch in branches:
        parts += 1
        inputs += branch.kind.inputs
        outputs += len(branch.outputs)
        hidden += len(branch.hidden)
    return SizeCounts(parts, inputs, outputs, hidden)


def subtree_sizes(branches: Sequence[MutableGenome]) -> list[Counts]:
    """Return the counts of every subtree of a whole tree, given depth first."""
    sums: list[Counts] = []
    of_children: list[Counts] = []
    for branch in reversed(branches):
        parts, inputs = 1, branch.kind.inputs
        outputs, hidden = len(branch.outputs), len(branch.hidden)
        for _ in branch.children:
            p, i, o, h = of_children.pop()
            parts, inputs = parts + p, inputs + i
            outputs, hidden = outputs + o, hidden + h
        counts = parts, inputs, outputs, hidden
        of_children.append(counts)
        sums.append(counts)
    sums.reverse()
    return sums


def fitting_subtrees(sizes: Sequence[Counts], room: SizeCounts) -> list[int]:
    """Return the places of a tree's subtrees, but itself, that fit into ``room``."""
    parts, inputs, outputs, hidden = room
    return [
        place
        for place, (p, i, o, h) in enumerate(sizes)
        if p <= parts and i <= inputs and o <= outputs and h <= hidden and place
    ]
