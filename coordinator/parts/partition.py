"""Division of an arena's robots into parts that several workers advance.

Robots whose boxes do not overlap cannot act on each other, so groups that overlaps
connect may be advanced apart. What parts there are has no influence on any result.
"""

from collections.abc import Mapping, Sequence

import numpy as np

from schema.robot.groups import Group, connected_components, overlaps
from schema.robot.ids import BirthId
from schema.wire.arena import Box

GROWTH_M = 0.05
"""A robot may leave the box that it swept before by this without a repeat [m]."""
MOVE_COST = 0.3
"""Least gain of a move, as a share of the cost of the robots that move.

To build a robot's model takes as long as about three simulated seconds of it, and a
division lasts for about ten exchanges.
"""
BALANCED = 0.02
"""Difference of two parts that is left as it is, as a share of the more expensive."""


def overlapping(boxes: Mapping[BirthId, Box]) -> list[tuple[BirthId, BirthId]]:
    """Return the pairs of robots whose boxes overlap or meet."""
    if not boxes:
        return []
    births = list(boxes)
    sides = np.array(list(boxes.values())).T.reshape(2, 2, -1)
    first, second = np.triu(overlaps(sides), 1).nonzero()
    pairs = zip(first.tolist(), second.tolist(), strict=True)
    return [(births[a], births[b]) for a, b in pairs]


def groups_of(
    boxes: Mapping[BirthId, Box], clusters: Sequence[Group], growth_m: float = 0.0
) -> list[Group]:
    """Return the robots that must be advanced together, group by group.

    Clusters are robots of one model; a robot of none is alone. Each box grows on each
    side.
    """
    grown = {
        birth: (west - growth_m, south - growth_m, east + growth_m, north + growth_m)
        for birth, (west, south, east, north) in boxes.items()
    }
    alone = grown.keys() - {birth for members in clusters for birth in members}
    return connected_components(
        [*clusters, *((birth,) for birth in alone)], overlapping(grown)
    )


def divide(
    groups: Sequence[Group],
    costs: Mapping[BirthId, float],
    held: Mapping[BirthId, int],
    parts: int,
) -> list[list[Group]]:
    """Return the groups of each part, with few moves.

    A group stays where most of it is, until moving it lowers the cost of the most
    expensive part by more than the move costs. Parts that hardly differ stay. Costs are
    of an exchange of each robot, in any unit; ``held`` is the present part of each that
    has one.
    """
    cost_of = {group: sum(costs[birth] for birth in group) for group in groups}
    divided: list[list[Group]] = [[] for _ in range(parts)]
    loads = [0.0] * parts
    for group in sorted(groups, key=lambda group: (-cost_of[group], group)):
        part = _present(group, costs, held, parts)
        if part is None:
            part = loads.index(min(loads))
        divided[part].append(group)
        loads[part] += cost_of[group]
    while True:
        heavy, light = loads.index(max(loads)), loads.index(min(loads))
        difference = loads[heavy] - loads[light]
        gains = {
            group: min(cost_of[group], difference - cost_of[group])
            - MOVE_COST * cost_of[group]
            for group in divided[heavy]
        }
        group = max(gains, key=gains.__getitem__, default=())
        is_balanced = difference <= BALANCED * loads[heavy]
        if is_balanced or not group or gains[group] <= 0.0:
            return [sorted(each) for each in divided]
        divided[heavy].remove(group)
        divided[light].append(group)
        loads[heavy] -= cost_of[group]
        loads[light] += cost_of[group]


def _present(
    group: Group,
    costs: Mapping[BirthId, float],
    held: Mapping[BirthId, int],
    parts: int,
) -> int | None:
    """Return the part that has most of a group; None if none has any of it."""
    shares = [0.0] * parts
    is_held = False
    for birth in group:
        part = held.get(birth, parts)
        if part < parts:
            is_held = True
            shares[part] += costs[birth]
    return shares.index(max(shares)) if is_held else None
