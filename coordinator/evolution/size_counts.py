"""How much of what restrictions limit a tree holds."""

from collections.abc import Iterable, Sequence
from typing import NamedTuple

from coordinator.evolution.mutable_genome import MutableGenome
from schema.experiment.document import Space


class SizeCounts(NamedTuple):
    """What restrictions limit, of a tree or a part of one."""

    parts: int
    inputs: int
    outputs: int
    hidden: int

    def plus(self, other: "SizeCounts", sign: int = 1) -> "SizeCounts":
        """Return the sum with another tally, or the difference for sign -1."""
        return SizeCounts(
            self.parts + sign * other.parts,
            self.inputs + sign * other.inputs,
            self.outputs + sign * other.outputs,
            self.hidden + sign * other.hidden,
        )

    def fits(self, room: "SizeCounts") -> bool:
        """Return whether it exceeds none of another tally's numbers."""
        return (
            self.parts <= room.parts
            and self.inputs <= room.inputs
            and self.outputs <= room.outputs
            and self.hidden <= room.hidden
        )


def greatest(space: Space) -> SizeCounts:
    """Return what a whole tree may hold at most."""
    return SizeCounts(
        space.max_parts, space.max_inputs, space.max_outputs, space.max_hidden
    )


def tally(branches: Iterable[MutableGenome]) -> SizeCounts:
    """Return the tally of some branches, without what hangs on them."""
    parts = inputs = outputs = hidden = 0
    for branch in branches:
        parts += 1
        inputs += branch.kind.inputs
        outputs += len(branch.outputs)
        hidden += len(branch.hidden)
    return SizeCounts(parts, inputs, outputs, hidden)


def tallies(branches: Sequence[MutableGenome]) -> dict[MutableGenome, SizeCounts]:
    """Return the tally of every subtree of a tree that is given depth first.

    They come in the order of their tops.
    """
    sums: dict[MutableGenome, SizeCounts] = {}
    for branch in reversed(branches):
        parts, inputs = 1, branch.kind.inputs
        outputs, hidden = len(branch.outputs), len(branch.hidden)
        for child in branch.children.values():
            below = sums[child]
            parts += below.parts
            inputs += below.inputs
            outputs += below.outputs
            hidden += below.hidden
        sums[branch] = SizeCounts(parts, inputs, outputs, hidden)
    return dict(reversed(sums.items()))
