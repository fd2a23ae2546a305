"""Intersecting parts of a body, by the separating axes of their oriented boxes.

Two boxes are apart exactly if they are apart along one of 15 directions: the three
axes of each box and the nine cross products of an axis of either. The least overlap
along these directions is the depth of the intersection.

Pairs with a cylinder are examined in ``analyzer.cylinders``.

Source: Gottschalk, Lin, Manocha, *OBBTree*, 1996, section 5.
"""

from dataclasses import replace

import numpy as np
import numpy.typing as npt

from analyzer.boxes import Boxes, Indices
from analyzer.cylinders import round_separation
from schema.experiment.document import Vetting
from schema.robot.results import Floats
from schema.robot.robot import Robot

Mask = npt.NDArray[np.bool_]

PARALLEL = 1e-12
"""Squared sine below which two edges count as parallel and have no cross product.

At 0.1 m this hides less than 1e-7 m of separation, a tenth of the tolerance.
"""
ALIGNED = 1e-12
"""Greatest deviation of a box from the axes that counts as axis-aligned."""

_NEXT = np.array([1, 2, 0])
_AFTER = np.array([2, 0, 1])


def intersecting_parts(
    boxes: Boxes, robot: Robot, vetting: Vetting
) -> tuple[tuple[int, int], ...]:
    """Return the pairs of parts that intersect, joints at zero.

    Boxes of one part, or of two parts that are attached to each other, may intersect.

    Args:
        boxes: the robot's boxes.
        robot: the robot; it tells which parts are attached to each other.
        vetting: ``overlap`` counts depths > ``tolerance_m``; ``contact`` counts gaps
            <= ``tolerance_m`` along every axis.

    Returns:
        Index pairs of parts, each ascending, in ascending order.
    """
    near = _near_parts(boxes, robot, vetting)
    if not np.count_nonzero(near):
        return ()
    one, other = np.nonzero(near.repeat(boxes.count, 0).repeat(boxes.count, 1))
    gap = np.maximum(
        boxes.lower[one] - boxes.upper[other], boxes.lower[other] - boxes.upper[one]
    )
    hit = _is_hit(gap.max(axis=1), vetting)
    one, other = one[hit], other[hit]
    # Axis-aligned boxes equal their hulls.
    is_tilted = np.abs(boxes.rotation).max(axis=2).min(axis=1) < 1.0 - ALIGNED
    tilted = np.flatnonzero(is_tilted[one] | is_tilted[other])
    if tilted.size:
        hit = np.ones(one.size, dtype=bool)
        hit[tilted] = _is_hit(separation(boxes, one[tilted], other[tilted]), vetting)
        one, other = one[hit], other[hit]
    if boxes.round:
        # Boxes around cylinders meet; the cylinders may be apart all the same.
        hit = _is_hit(_round_separations(boxes, one, other, vetting), vetting)
        one, other = one[hit], other[hit]
    part = np.arange(len(boxes.count)).repeat(boxes.count)
    pairs = zip(part[one].tolist(), part[other].tolist(), strict=True)
    return tuple(sorted(set(pairs)))


def separation(boxes: Boxes, first: Indices, second: Indices) -> Floats:
    """Return the greatest separation of boxes along their 15 axes.

    Args:
        boxes: all boxes.
        first: (K,) indices of the first box of each pair.
        second: (K,) indices of the second box of each pair.

    Returns:
        (K,) [m]: a positive value is a gap (at most the distance), zero is contact, a
        negative value is minus the depth.
    """
    half_a, half_b = boxes.half[first], boxes.half[second]
    to_a = boxes.rotation[first].transpose(0, 2, 1)
    # Box b and its centre in the frame of box a.
    turn = to_a @ boxes.rotation[second]
    offset = boxes.centre[second] - boxes.centre[first]
    seen = np.einsum("kij,kj->ki", to_a, offset)
    size = np.abs(turn)

    on_a = np.abs(seen) - half_a - np.einsum("kij,kj->ki", size, half_b)
    from_b = np.abs(np.einsum("kij,ki->kj", turn, seen))
    on_b = from_b - half_b - np.einsum("kij,ki->kj", size, half_a)

    reach = (
        half_a[:, _NEXT, None] * size[:, _AFTER]
        + half_a[:, _AFTER, None] * size[:, _NEXT]
        + half_b[:, None, _NEXT] * size[:, :, _AFTER]
        + half_b[:, None, _AFTER] * size[:, :, _NEXT]
    )
    along = np.abs(
        seen[:, _AFTER, None] * turn[:, _NEXT] - seen[:, _NEXT, None] * turn[:, _AFTER]
    )
    squared_sine = 1.0 - turn * turn
    is_axis = squared_sine > PARALLEL
    sine = np.sqrt(np.where(is_axis, squared_sine, 1.0))
    crossed = np.where(is_axis, (along - reach) / sine, -np.inf)
    parts = (on_a, on_b, crossed.reshape(-1, 9))
    separations: Floats = np.concatenate(parts, axis=1).max(axis=1)
    return separations


def _round_separations(
    boxes: Boxes, first: Indices, second: Indices, vetting: Vetting
) -> Floats:
    """Return the separation of pairs whose boxes meet; bounds where they decide."""
    curved = list(boxes.round)
    half = boxes.half.copy()
    half[curved, :2] *= 0.7
    # Where boxes inside of the cylinders meet, no search is needed.
    found = separation(replace(boxes, half=half), first, second)
    is_round = np.isin(first, curved) | np.isin(second, curved)
    for pair in np.flatnonzero(is_round & ~_is_hit(found, vetting)).tolist():
        ends = int(first[pair]), int(second[pair])
        found[pair] = round_separation(boxes, *ends, vetting.tolerance_m)
    return np.where(is_round, found, -np.inf)


def _is_hit(apart: Floats, vetting: Vetting) -> Mask:
    if vetting.mode == "contact":
        return apart <= vetting.tolerance_m
    return apart < -vetting.tolerance_m


def _near_parts(boxes: Boxes, robot: Robot, vetting: Vetting) -> Mask:
    """Return (P, P) which parts are not attached and have hulls that meet.

    A part lies within its hull, so parts with separate hulls are apart. The lesser of
    two indices comes first.
    """
    # A part without boxes meets no other part.
    solid = np.flatnonzero(boxes.count)
    start = (boxes.count.cumsum() - boxes.count)[solid]
    lower = np.full((3, len(boxes.count)), np.inf)
    upper = -lower
    lower[:, solid] = np.minimum.reduceat(boxes.lower.T, start, axis=1)
    upper[:, solid] = np.maximum.reduceat(boxes.upper.T, start, axis=1)
    gap = np.maximum.reduce(lower[:, :, None] - upper[:, None])
    meet = _is_hit(np.maximum(gap, gap.T), vetting)
    # Parents come before their children.
    parent = np.array([part.parent for part in robot.parts])
    index = np.arange(len(parent))
    near: Mask = meet & (index[:, None] < index) & (index[:, None] != parent)
    return near
