"""One exchange of an arena: all its parts advance to one step, until none overlaps.

Parts are advanced as if they were alone. If robots of two of them came within reach of
each other, their results are wrong: their groups are advanced again, together, from
their states before the exchange. What is left is equal to the advance of the whole
arena, to the last bit.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from coordinator.parts.partition import groups_of
from schema.robot.groups import Group
from schema.robot.ids import BirthId
from schema.wire.arena import Advance, Box
from schema.wire.arena_state import ArenaState


@dataclass(frozen=True, slots=True)
class PartResult:
    """Result of robots that were advanced together.

    Attributes:
        advance: without state.
        state: of the robots at the end.
        boxes: that all of them swept, also those that diverged.
        costs: of each of them, in any unit.
        works: motor work so far in the advance, of those that live [J]; empty if it is
            not measured.
    """

    advance: Advance
    state: ArenaState
    boxes: dict[BirthId, Box]
    costs: dict[BirthId, float]
    works: dict[BirthId, float]


@dataclass(slots=True)
class Exchange:
    """The results of the parts, and which of their robots must be advanced again.

    Attributes:
        clusters: before the exchange; newborns may be missing.
        parts: robots of each part, newborns included.
        repeated: robots that are advanced again, together.
    """

    clusters: Sequence[Group]
    parts: Mapping[int, frozenset[BirthId]]
    repeated: frozenset[BirthId] = frozenset()
    _results: dict[int, PartResult] = field(default_factory=dict)
    _again: PartResult | None = None

    def take(self, part: int, result: PartResult) -> None:
        """Take the result of a part."""
        self._results[part] = result

    def take_repeated(self, result: PartResult) -> None:
        """Take the result of the robots that were advanced again."""
        self._again = result

    @property
    def missing(self) -> list[int]:
        """Parts without a result."""
        return [part for part in self.parts if part not in self._results]

    def overlap(self) -> bool:
        """Look for robots of different results in reach of each other.

        They join ``repeated``, which is to be advanced again.

        Returns:
            Whether there are any.
        """
        boxes: dict[BirthId, Box] = {}
        source: dict[BirthId, int] = {}
        clusters = list(self.clusters)
        for number, (result, births) in enumerate(self.chosen()):
            boxes |= {birth: result.boxes[birth] for birth in births}
            source |= dict.fromkeys(births, number)
            clusters += [each for each in result.state.clusters if each[0] in births]
        mixed = {
            birth
            for group in groups_of(boxes, clusters)
            if len({source[birth] for birth in group}) > 1
            for birth in group
        }
        self.repeated |= mixed
        if mixed:
            self._again = None
        return bool(mixed)

    def chosen(self) -> list[tuple[PartResult, frozenset[BirthId]]]:
        """Return the results, each with the robots for which it is valid."""
        valid = [
            (self._results[part], births - self.repeated)
            for part, births in self.parts.items()
        ]
        return valid if self._again is None else [*valid, (self._again, self.repeated)]
