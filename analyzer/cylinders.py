"""Separation of two convex bodies, boxes or cylinders, by search.

Two convex bodies are apart exactly if they are apart along some direction. The search
starts from the axes of both bodies, their cross products and the directions between
the bodies, and refines the best of them. It is conservative: bodies that it finds apart
are apart, but it may take a small gap for an intersection. In 400 random pairs about
0.5 m long it never did so for gaps above 0.1 mm (tests/analyzer/test_cylinders.py).
"""

import math
from typing import NamedTuple

import numpy as np

from schema.robot.trace import Floats

_STARTS = 2
"""Directions that are refined."""
_FIRST_STEP, _LAST_STEP, _SHRINK = 0.5, 1e-7, 0.6
"""Tangents of the angles of the search, and the ratio of two of them."""
_MOST_LEVELS = 150
"""Steps of the search, those that find a better direction included."""
_AROUND = 8
"""Neighbours of a direction that are tried at each step."""
_TURN = 2.4
"""Rotation of these neighbours from step to step, so that none is missed [rad]."""


class PlacedSolid(NamedTuple):
    """Box or cylinder in the core's frame.

    Attributes:
        rotation: (3, 3) its frame to core frame; the axis of a cylinder is z.
        centre: (3,) [m].
        half: (3,) half of the lengths along its own axes [m].
        is_round: it is a cylinder.
    """

    rotation: Floats
    centre: Floats
    half: Floats
    is_round: bool


def least_separation(
    first: PlacedSolid, second: PlacedSolid, enough: float = math.inf
) -> float:
    """Return a lower bound on the separation of two bodies.

    Args:
        first: one body.
        second: the other.
        enough: a bound from which on no better one is sought [m].

    Returns:
        [m]: a positive value is a gap, a negative one minus the depth.
    """
    offset = second.centre - first.centre

    def apart(ways: Floats) -> Floats:
        """Return the separation along unit vectors, (K, 3)."""
        gaps = ways @ offset
        for solid in (first, second):
            local = np.abs(ways @ solid.rotation)
            if solid.is_round:
                across = np.hypot(local[:, 0], local[:, 1])
                gaps = gaps - solid.half[0] * across - solid.half[2] * local[:, 2]
            else:
                gaps = gaps - local @ solid.half
        return np.asarray(gaps)

    ways = _candidates([first.rotation, second.rotation], offset)
    ways = ways[np.argsort(-apart(ways), kind="stable")[:_STARTS]]
    best, step = apart(ways), _FIRST_STEP
    for level in range(_MOST_LEVELS):
        if best.max() > enough:
            break
        angles = level * _TURN + np.arange(_AROUND) * (2.0 * math.pi / _AROUND)
        tries = _neighbours(ways, step * np.cos(angles), step * np.sin(angles))
        gaps = apart(tries.reshape(-1, 3)).reshape(len(ways), _AROUND)
        chosen, rows = gaps.argmax(axis=1), np.arange(len(ways))
        is_better = gaps[rows, chosen] > best
        ways = np.where(is_better[:, None], tries[rows, chosen], ways)
        best = np.where(is_better, gaps[rows, chosen], best)
        if not is_better.any():
            step *= _SHRINK
            if step < _LAST_STEP:
                break
    return float(best.max())


def _candidates(turns: list[Floats], offset: Floats) -> Floats:
    """Return unit vectors to start from, (K, 3), in both senses."""
    own, other = turns[0].T, turns[1].T
    crossed = np.cross(own[:, None], other[None]).reshape(-1, 3)
    across = [offset - (offset @ axis) * axis for axis in (*own, *other)]
    ways = np.concatenate([own, other, crossed, [offset], across])
    lengths = np.linalg.norm(ways, axis=1)
    ways = ways[lengths > 1e-9] / lengths[lengths > 1e-9, None]  # noqa: PLR2004
    return np.concatenate([ways, -ways])


def _neighbours(ways: Floats, along: Floats, across: Floats) -> Floats:
    """Return unit vectors around each of some unit vectors, (K, A, 3)."""
    # The axis that is least parallel to a vector gives two tangents.
    helper = np.eye(3)[np.abs(ways).argmin(axis=1)]
    one = np.cross(ways, helper)
    one /= np.linalg.norm(one, axis=1, keepdims=True)
    two = np.cross(ways, one)
    aside = along[:, None] * one[:, None] + across[:, None] * two[:, None]
    moved = ways[:, None] + aside
    return np.asarray(moved / np.linalg.norm(moved, axis=2, keepdims=True))
