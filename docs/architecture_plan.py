"""Where boxes and arrows of a room lie, along and across its layers."""

from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from docs.architecture_rooms import Arrow, Room

GAP = 26.0
"""Space between two layers [px]."""
BETWEEN = 12.0
"""Space between two boxes of a layer [px]."""
TRACK = 8.0
"""Distance of two arrows that run side by side [px]."""

Point = tuple[float, float]


@dataclass(slots=True)
class Plan:
    """Where boxes and arrows of a room lie, along and across its layers."""

    layers: tuple[tuple[str, ...], ...]
    box: float
    """Extent of a box along the layers [px]."""
    boxes: dict[str, tuple[float, float, float]] = field(default_factory=dict)
    """Where a box begins along, and from where to where it reaches across."""
    arrows: list[tuple[str, list[Point]]] = field(default_factory=list)
    """Importer, and the corners that an arrow passes."""
    length: float = 0.0
    breadth: float = 0.0


def plan_of(room: Room, *, along: float, across: float) -> Plan:
    """Return where everything of a room lies.

    Args:
        room: what is drawn.
        along: extent of a box along the layers [px].
        across: extent of a box in the fullest layer [px].

    Returns:
        Boxes and arrows. Arrows to the next layer go straight or with a bend between
        the layers. All others go by a lane beside the layers: one line per importer
        and side, with branches.
    """
    plan = Plan(room.layers, along)
    columns = max(map(len, room.layers))
    breadth = columns * across + (columns - 1) * BETWEEN
    sides = _sides(room)
    order = [box for names in room.layers for box in names]
    users = {
        side: [box for box in order if side in (sides.get((box, one)) for one in order)]
        for side in (-1, 1)
    }
    lanes = {side: (len(users[side]) + 0.8) * TRACK for side in (-1, 1)}
    for row, names in enumerate(room.layers):
        each = (breadth - (len(names) - 1) * BETWEEN) / len(names)
        for place, box in enumerate(names):
            low = lanes[-1] + place * (each + BETWEEN)
            plan.boxes[box] = (row * (along + GAP), low, low + each)
    plan.length = len(room.layers) * (along + GAP) - GAP
    plan.breadth = lanes[-1] + breadth + lanes[1]
    _draw_near(plan, [arrow for arrow in sorted(room.arrows) if arrow not in sides])
    far = sorted(
        sides, key=lambda arrow: (order.index(arrow[0]), order.index(arrow[1]))
    )
    for one, other in far:
        side = sides[one, other]
        # The topmost importer has the outermost line.
        off = (users[side].index(one) + 0.6) * TRACK
        lane = off if side < 0 else plan.breadth - off
        come = [each for each, at in far if at == other and sides[each, at] == side]
        share = (come.index(one) + 1) / (len(come) + 1 + _leaves(other, side, sides))
        leaves = sum(at == one and sides[each, at] == side for each, at in far) + 1
        start = _exit(plan, one, side, leaves / (leaves + 1))
        end = _entry(plan, other, side, share)
        corners = [*start, (start[-1][0], lane), (end[0][0], lane), *end]
        plan.arrows.append((one, corners))
    return plan


def _sides(room: Room) -> dict[Arrow, int]:
    """Return on which side of the layers arrows to farther layers pass: -1 or 1.

    That of the importer if it is at one side only, else that of the imported.
    """
    row_of = {box: row for row, names in enumerate(room.layers) for box in names}
    sides = {}
    for one, other in room.arrows:
        if row_of[other] > row_of[one] + 1:
            found = [_side(room.layers[row_of[box]], box) for box in (one, other)]
            sides[one, other] = next((side for side in found if side), -1)
    return sides


def _side(names: tuple[str, ...], box: str) -> int:
    """Return at which end of its layer a box is; 0 in the middle, or at both."""
    return (box == names[-1]) - (box == names[0])


def _leaves(box: str, side: int, sides: Mapping[Arrow, int]) -> bool:
    """Return whether a line of a box leaves on a side."""
    return any(one == box and at == side for (one, _), at in sides.items())


def _is_at(plan: Plan, box: str, side: int) -> bool:
    """Return whether nothing lies between a box and the lane on a side."""
    return any(names[0 if side < 0 else -1] == box for names in plan.layers)


def _exit(plan: Plan, box: str, side: int, share: float) -> list[Point]:
    """Return the points by which a line leaves a box for the lane on a side."""
    begin, low, high = plan.boxes[box]
    if _is_at(plan, box, side):
        return [(begin + share * plan.box, low if side < 0 else high)]
    middle = (low + high) / 2 + side * (high - low) / 4
    return [(begin + plan.box, middle), (begin + plan.box + 0.4 * GAP, middle)]


def _entry(plan: Plan, box: str, side: int, share: float) -> list[Point]:
    """Return the points by which a line reaches a box from the lane on a side."""
    begin, low, high = plan.boxes[box]
    if _is_at(plan, box, side):
        return [(begin + share * plan.box, low if side < 0 else high)]
    across = low + (0.25 if side < 0 else 0.75) * (high - low)
    return [(begin - 0.6 * GAP, across), (begin, across)]


def _draw_near(plan: Plan, near: Sequence[Arrow]) -> None:
    """Add the arrows to the next layer."""
    bends: dict[float, list[tuple[str, Point, Point]]] = defaultdict(list)
    for one, other in near:
        begin, low, high = plan.boxes[one]
        end, least, most = plan.boxes[other]
        start = begin + plan.box
        if min(high, most) - max(low, least) > TRACK:
            middle = (max(low, least) + min(high, most)) / 2
            plan.arrows.append((one, [(start, middle), (end, middle)]))
            continue
        # From the near end of one box to the near end of the other.
        near_end, far_end = (0.75, 0.2) if low < least else (0.25, 0.8)
        ends = (
            (start, low + near_end * (high - low)),
            (end, least + far_end * (most - least)),
        )
        bends[start].append((one, *ends))
    for start, lines in bends.items():
        for place, (one, begin_at, end_at) in enumerate(lines):
            at = start + GAP * (place + 1) / (len(lines) + 2)
            corners = [begin_at, (at, begin_at[1]), (at, end_at[1]), end_at]
            plan.arrows.append((one, corners))
