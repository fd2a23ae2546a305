"""Which parts of a body intersect: oriented boxes and their separating axes.

Two boxes are apart along some direction exactly if they are apart along one of
15: the three axes of each and the nine cross products of an axis of either.
The least overlap along these is how deep they intersect.

Source: Gottschalk, Lin, Manocha, *OBBTree*, 1996, section 5.
"""

import numpy as np
import numpy.typing as npt

from analyzer.boxes import Boxes
from schema.experiment.document import Vetting
from schema.robot.results import Floats
from schema.robot.robot import Robot

Indices = npt.NDArray[np.intp]
Mask = npt.NDArray[np.bool_]

PARALLEL = 1e-12
"""Squared sine below which two edges count as parallel and span no axis.

At 0.1 m this hides less than 1e-7 m of separation, a tenth of the tolerance.
"""
ALIGNED = 1e-12
"""A box this close to the axes equals its axis-aligned hull."""

_NEXT = np.array([1, 2, 0])
_AFTER = np.array([2, 0, 1])


def intersecting_parts(
    boxes: Boxes, robot: Robot, vetting: Vetting
) -> tuple[tuple[int, int], ...]:
    """Return which parts intersect, joints at zero.

    Boxes of one part, or of two parts that sit on each other, may intersect:
    nothing but their shape decides about that.

    Args:
        boxes: the robot's boxes.
        robot: says which parts sit on each other.
        vetting: ``overlap`` wants a depth > ``tolerance_m``; ``contact`` is content
            with a gap <= ``tolerance_m`` along every axis.

    Returns:
        Index pairs of parts, each ascending, in ascending order.
    """
    near = _near_parts(boxes, robot, vetting)
    if not np.count_nonzero(near):
        return ()
    one, other = np.nonzero(near.repeat(boxes.count, 0).repeat(boxes.count, 1))
    hit = _hulls_meet(boxes, one, other, vetting)
    one, other = one[hit], other[hit]
    # Among axis-aligned boxes the hulls have decided already.
    is_tilted = _is_tilted(boxes)
    tilted = np.flatnonzero(is_tilted[one] | is_tilted[other])
    if tilted.size:
        hit = np.ones(one.size, dtype=bool)
        hit[tilted] = _is_hit(separation(boxes, one[tilted], other[tilted]), vetting)
        one, other = one[hit], other[hit]
    part = np.arange(len(boxes.count)).repeat(boxes.count)
    pairs = zip(part[one].tolist(), part[other].tolist(), strict=True)
    return tuple(sorted(set(pairs)))


def separation(boxes: Boxes, first: Indices, second: Indices) -> Floats:
    """Return how far boxes are apart along the best of their 15 axes.

    Args:
        boxes: where they sit.
        first: (K,) indices of boxes.
        second: (K,) indices of the boxes that they are held against.

    Returns:
        (K,) [m]: positive is a gap (at most the distance), zero touching, negative
        minus the depth.
    """
    half_a, half_b = boxes.half[first], boxes.half[second]
    to_a = boxes.rotation[first].transpose(0, 2, 1)
    # Box b and its centre as box a sees them.
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


def _is_hit(apart: Floats, vetting: Vetting) -> Mask:
    if vetting.mode == "contact":
        return apart <= vetting.tolerance_m
    return apart < -vetting.tolerance_m


def _is_tilted(boxes: Boxes) -> Mask:
    largest = np.abs(boxes.rotation).max(axis=2)
    tilted: Mask = largest.min(axis=1) < 1.0 - ALIGNED
    return tilted


def _near_parts(boxes: Boxes, robot: Robot, vetting: Vetting) -> Mask:
    """Return which parts are not joined and have hulls that meet, (P, P).

    A part lies within its hull, so hulls apart are parts apart. The lesser of two
    indices comes first.
    """
    # A part without boxes meets nobody, wherever it is.
    solid = np.flatnonzero(boxes.count)
    start = (boxes.count.cumsum() - boxes.count)[solid]
    lower = np.full((3, len(boxes.count)), np.inf)
    upper = -lower
    lower[:, solid] = np.minimum.reduceat(boxes.lower.T, start, axis=1)
    upper[:, solid] = np.maximum.reduceat(boxes.upper.T, start, axis=1)
    gap = np.maximum.reduce(lower[:, :, None] - upper[:, None])
    meet = _is_hit(np.maximum(gap, gap.T), vetting)
    # A parent stands before its children.
    parent = np.array([part.parent for part in robot.parts])
    index = np.arange(len(parent))
    near: Mask = meet & (index[:, None] < index) & (index[:, None] != parent)
    return near


def _hulls_meet(boxes: Boxes, one: Indices, other: Indices, vetting: Vetting) -> Mask:
    """Return whether the hulls of boxes meet; a box lies within its hull."""
    lower, upper = boxes.lower, boxes.upper
    gap = np.maximum(lower[one] - upper[other], lower[other] - upper[one])
    return _is_hit(gap.max(axis=1), vetting)
