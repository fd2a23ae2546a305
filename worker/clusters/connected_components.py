"""Groups of robots that hold together along links, and who stands across."""

from collections.abc import Iterable, Sequence

from schema.robot.ids import BirthId

Group = tuple[BirthId, ...]
"""Who lives together, ascending."""


def across(groups: Sequence[Sequence[int]]) -> list[tuple[int, int]]:
    """Return the pairs of rows whose ends are in two groups, lesser row first."""
    return sorted(
        (min(a, b), max(a, b))
        for number, group in enumerate(groups)
        for other in groups[number + 1 :]
        for a in group
        for b in other
    )


def connected_components(
    groups: Iterable[Group], links: Iterable[tuple[BirthId, BirthId]]
) -> list[Group]:
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
