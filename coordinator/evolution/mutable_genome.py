"""A genome in the making: the tree that generation and variation cut and graft.

A genome never changes; a `MutableGenome` may. It is thawed from a genome, worked upon
within one function call, and frozen into a new genome.
"""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from itertools import count

from schema.parts import BodySpace, PartType
from schema.robot.brain import Layer
from schema.robot.genome import ConnectionGene, Genome, NeuronGene, Node, walk
from schema.robot.ids import BirthId


@dataclass(slots=True, eq=False)
class MutableGenome:
    """A node that may still change; its fields are those of `Node`.

    ``parent`` and ``parent_slot`` are None and -1 at the root; ``children`` stand by
    ascending slot.
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
        """Return the slots that nothing sits on, ascending."""
        return [
            slot
            for slot in range(self.kind.arity)
            if slot != self.slot and slot not in self.children
        ]

    def graft(self, child: "MutableGenome", slot: int) -> None:
        """Put a child on a slot, in the place of whatever sat there."""
        child.parent, child.parent_slot = self, slot
        self.children = dict(sorted({**self.children, slot: child}.items()))

    def cut(self) -> None:
        """Take this branch, which must not be a root, off its parent."""
        assert self.parent is not None
        del self.parent.children[self.parent_slot]
        self.parent, self.parent_slot = None, -1

    def neurons(self, *layers: Layer) -> list[tuple[Layer, int]]:
        """Return (layer, offset) of its own neurons of some layers, in turn."""
        found: list[tuple[Layer, int]] = []
        for layer in layers:
            if layer == "input":
                count = self.kind.inputs
            else:
                count = len(self.outputs if layer == "output" else self.hidden)
            if count:
                found += [(layer, k) for k in range(count)]
        return found


def gene_ids(birth: BirthId) -> Iterator[int]:
    """Return the gene identities that an individual may give to its new parts.

    They are unique over a run: 16 bits of island, 32 of birth number and 16 of a
    running index from 1, so that no gene is 0.
    """
    return count((birth.island << 48 | birth.number << 16) + 1)


def to_mutable(genome: Genome, space: BodySpace) -> MutableGenome:
    """Return a genome as a tree that may change."""
    branches: list[MutableGenome] = []
    for node, parent, slot in walk(genome):
        branch = MutableGenome(
            space[node.kind],
            node.slot,
            node.orientation,
            node.parameters,
            node.gene,
            node.outputs,
            node.hidden,
            node.connections,
        )
        branches.append(branch)
        if parent >= 0:
            above = branch.parent = branches[parent]
            branch.parent_slot = slot
            above.children[slot] = branch
    return branches[0]


def to_genome(branches: Sequence[MutableGenome]) -> Genome:
    """Return a tree, given depth first, as a genome."""
    frozen: dict[MutableGenome, Node] = {}
    for branch in reversed(branches):
        frozen[branch] = Node(
            branch.kind.name,
            branch.slot,
            branch.orientation,
            branch.parameters,
            branch.gene,
            branch.outputs,
            branch.hidden,
            branch.connections,
            tuple([(slot, frozen[child]) for slot, child in branch.children.items()]),
        )
    return frozen[branches[0]]


def preorder(root: MutableGenome) -> list[MutableGenome]:
    """Return a tree's branches depth first, children by ascending slot."""
    order: list[MutableGenome] = []
    stack = [root]
    while stack:
        branch = stack.pop()
        order.append(branch)
        if branch.children:
            stack.extend(reversed(branch.children.values()))
    return order


def copied(root: MutableGenome) -> MutableGenome:
    """Return a copy of a tree that hangs nowhere."""
    twins: dict[MutableGenome, MutableGenome] = {}
    for branch in preorder(root):
        twin = twins[branch] = MutableGenome(
            branch.kind,
            branch.slot,
            branch.orientation,
            branch.parameters,
            branch.gene,
            branch.outputs,
            branch.hidden,
            branch.connections,
        )
        if branch is not root:
            assert branch.parent is not None
            twins[branch.parent].graft(twin, branch.parent_slot)
    return twins[root]


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
    """Return the branch that a path leads to, or None if it leads nowhere."""
    here: MutableGenome | None = branch
    for slot in path:
        if here is None:
            return None
        here = here.parent if slot == here.slot else here.children.get(slot)
    return here


def level(branches: Iterable[MutableGenome]) -> None:
    """Turn the levelled parts of a tree, given depth first, to its core's plane.

    Walking outwards, the turns add up; every part that is levelled gets the turn
    that brings the sum back to zero, all others keep theirs.

    Source: facts of the original, section 2 (planarity).
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
