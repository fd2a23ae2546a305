"""Groups of robots that act on each other."""

from collections.abc import Iterable

import numpy as np
import numpy.typing as npt

from schema.robot.ids import BirthId
from schema.robot.trace import Floats

Group = tuple[BirthId, ...]
"""Robots, ascending."""
Links = Iterable[tuple[BirthId, BirthId]]
Mask = npt.NDArray[np.bool_]


def connected_components(groups: Iterable[Group], links: Links) -> list[Group]:
    """Return groups joined along links, each and all ascending."""
    parent: dict[BirthId, BirthId] = {}
    for group in groups:
        for birth in group:
            parent[birth] = group[0]

    def root(birth: BirthId) -> BirthId:
        while parent[birth] != birth:
            birth = parent[birth]
        return birth

    for first, second in links:
        ends = sorted((root(first), root(second)))
        parent[ends[1]] = ends[0]
    found: dict[BirthId, list[BirthId]] = {}
    for birth in sorted(parent):
        found.setdefault(root(birth), []).append(birth)
    return [tuple(found[first]) for first in sorted(found)]


def overlaps(boxes: Floats) -> Mask:
    """Return whether the boxes of R robots overlap or meet, (R, R).

    They are (2, 2, R): least x, y, then greatest x, y [m].
    """
    low, high = boxes
    is_near = low[0][:, None] <= high[0]
    is_beside = low[1][:, None] <= high[1]
    is_near &= is_beside
    is_near &= is_near.T.copy()
    return np.asarray(is_near)
