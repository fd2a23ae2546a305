"""One exchange of an arena: all its parts advance to one step, until none overlaps.

Parts are advanced as if they were alone. If robots of two of them came within reach of
each other, their results are wrong: their groups are advanced again, together, from
their states before the exchange. What is left is equal to the advance of the whole
arena, to the last bit. The results of all parts are joined to those of one worker.
"""

from collections import Counter
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import chain

from msgspec import structs

from coordinator.parts.partition import groups_of
from schema.robot.groups import Group
from schema.robot.ids import BirthId
from schema.wire.arena import Advance, Box, Casualty, Judgement, Touch
from schema.wire.arena_state import ArenaState, joined_states, states_of
from schema.wire.poses import PoseArrays


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
        """Return whether robots of different results are in reach of each other.

        They join ``repeated``, which is to be advanced again.
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


Chosen = Sequence[tuple[PartResult, Collection[BirthId]]]
"""Results, each with the robots for which it is valid."""


def joined(chosen: Chosen) -> PartResult:
    """Return the result of all robots of an exchange."""
    judgements: list[Judgement] = []
    casualties: list[Casualty] = []
    touches: list[Touch] = []
    poses: list[PoseArrays] = []
    boxes: dict[BirthId, Box] = {}
    costs: dict[BirthId, float] = {}
    works: dict[BirthId, float] = {}
    for result, births in chosen:
        advance = result.advance
        judgements += [one for one in advance.judgements if one.birth in births]
        casualties += [lost for lost in advance.casualties if lost.birth in births]
        touches += [touch for touch in advance.touches if touch.first in births]
        sampled = PoseArrays.received(advance.poses)
        is_all = births == result.boxes.keys()
        poses.append(sampled if is_all else sampled.of(births))
        boxes |= {birth: result.boxes[birth] for birth in births}
        costs |= {birth: result.costs[birth] for birth in births}
        works |= {b: work_j for b, work_j in result.works.items() if b in births}
    state = joined_states([states_of(each.state, births) for each, births in chosen])
    advance = Advance(
        step=state.step,
        digest=state.digest,
        judgements=tuple(sorted(judgements, key=lambda one: one.birth)),
        casualties=tuple(sorted(casualties, key=lambda lost: (lost.step, lost.birth))),
        touches=tuple(sorted(touches, key=lambda one: (one.first, one.second))),
        poses=PoseArrays.joined(poses).message(),
        work_j=tuple(works[birth] for birth in state.births) if works else (),
    )
    return PartResult(advance, state, boxes, costs, works)


def continued(before: Advance, after: Advance, interval_s: float) -> Advance:
    """Return an advance that two exchanges made, one after the other.

    Durations of touches are multiples of an interval, and so are their sums [s].
    """
    counts = Counter[tuple[BirthId, BirthId]]()
    for touch in chain(before.touches, after.touches):
        counts[touch.first, touch.second] += round(touch.duration_s / interval_s)
    poses = [PoseArrays.received(each.poses) for each in (before, after)]
    return structs.replace(
        after,
        casualties=before.casualties + after.casualties,
        touches=tuple(
            Touch(*pair, count * interval_s) for pair, count in sorted(counts.items())
        ),
        poses=PoseArrays.joined(poses).message(),
    )
