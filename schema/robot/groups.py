"""Groups of robots that act on each other."""

from collections.abc import Iterable

from schema.robot.ids import BirthId

Group = tuple[BirthId, ...]
"""Robots, ascending."""
Links = Iterable[tuple[BirthId, BirthId]]


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
