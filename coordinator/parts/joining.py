"""Results of parts of an arena as the one result that one worker would return."""

from collections import Counter
from collections.abc import Collection, Sequence
from itertools import chain

from msgspec import structs

from coordinator.parts.exchange import PartResult
from schema.robot.ids import BirthId
from schema.wire.arena import Advance, Box, Casualty, Judgement, Touch
from schema.wire.arena_state import joined_states, states_of
from schema.wire.poses import PoseArrays

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
