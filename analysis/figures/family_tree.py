"""The best robots, their ancestors, and the founders of their parts."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations
from pathlib import Path

import pyarrow as pa
import pyarrow.compute as pc

from analysis.measures.ancestry import ancestors, parents_first, parents_of
from analysis.measures.population_table import individual_ids, rows_of

LEVELS = 5
"""Levels of reproduction that a family tree shows, the robot's own included."""
_SWEEPS = 12
"""Orders of a tree's levels that are tried."""

LINEAGE = pa.schema(
    [
        pa.field("experiment", pa.string()),
        pa.field("order", pa.int64()),
        pa.field("number", pa.int64()),
        pa.field("rank", pa.int64()),
        pa.field("parents", pa.list_(pa.int64())),
    ]
)
"""Ancestors of an experiment's best robot: births row, number of birth on its island,
rank, parents' births rows."""


@dataclass(frozen=True, slots=True)
class Best:
    """The fittest robot of the last populations of an experiment's runs."""

    experiment: str
    folder: Path
    birth_island: int
    birth: int
    fitness: float


@dataclass(frozen=True, slots=True)
class Family:
    """A robot and its nearest ancestors, as rows of the births table.

    Attributes:
        levels: the robot, its parents, their parents, and so on; each ancestor is
            listed once, on its nearest level.
        edges: (child, parent) of those.
        founders: robots without parents whose parts survive in any of them, the
            founder with the most parts first.
        founder_of: founder of each gene that a founder has.
    """

    levels: tuple[tuple[int, ...], ...]
    edges: tuple[tuple[int, int], ...]
    founders: tuple[int, ...]
    founder_of: dict[int, int]


def best_robots(robots: pa.Table) -> list[Best]:
    """Return the best robot of each experiment, sorted by the experiment's name.

    Args:
        robots: with the columns of ``outputs``; the first of equally fit robots is
            the best.
    """
    found: dict[str, Best] = {}
    columns = ["experiment", "folder", "birth_island", "birth", "fitness"]
    last = robots.filter(pc.field("is_last")).select(columns)
    for row in last.to_pylist():
        known = found.get(row["experiment"])
        if known is None or row["fitness"] > known.fitness:
            found[row["experiment"]] = Best(**{**row, "folder": Path(row["folder"])})
    return [found[name] for name in sorted(found)]


def row_of(best: Best, births: pa.Table) -> int:
    """Return the births row of a robot; -1 if its birth is not recorded."""
    named = pa.table({"birth_island": [best.birth_island], "birth": [best.birth]})
    return int(rows_of(individual_ids(named), births)[0])


def family(births: pa.Table, row: int, levels: int = LEVELS) -> Family:
    """Return the nearest ancestors of a robot, and the founders of their parts.

    Args:
        births: births table of the robot's run.
        row: row of the robot.
        levels: number of levels, the robot's own included.

    Source: Hupkes 2016, figures 6.18 to 6.20.
    """
    parents = parents_of(births)
    shown = [[row]]
    known = {row}
    for _ in range(levels - 1):
        above = dict.fromkeys(up for down in shown[-1] for up in parents[down])
        nearest = [up for up in above if up not in known]
        if not nearest:
            break
        known.update(nearest)
        shown.append(nearest)
    edges = [(down, up) for level in shown for down in level for up in parents[down]]
    bodies = births["body"].combine_chunks()
    founder_of = _founders(bodies, parents)
    counts: dict[int, int] = {}
    for member in sorted(known):
        for gene in bodies[member].values.field("gene").to_pylist():
            if gene in founder_of:
                counts[founder_of[gene]] = counts.get(founder_of[gene], 0) + 1
    return Family(
        tuple(map(tuple, shown)),
        tuple((down, up) for down, up in edges if up in known),
        tuple(sorted(counts, key=lambda founder: (-counts[founder], founder))),
        founder_of,
    )


def _founders(bodies: pa.ListArray, parents: list[list[int]]) -> dict[int, int]:
    """Return the first robot without parents that has a gene, by gene."""
    founder_of: dict[int, int] = {}
    for row, couple in enumerate(parents):
        if not couple:
            for gene in bodies[row].values.field("gene").to_pylist():
                founder_of.setdefault(gene, row)
    return founder_of


def lineage(births: pa.Table, experiment: str, row: int) -> pa.Table:
    """Return a robot and all its ancestors as ``LINEAGE``; the robot is last.

    Args:
        births: births table of the robot's run.
        experiment: name of the run's experiment.
        row: row of the robot.
    """
    parents = parents_of(births)
    line = ancestors(parents)[row] | 1 << row
    rows = [order for order in parents_first(parents) if line >> order & 1]
    known = births.select(["birth", "rank"]).take(pa.array(rows)).to_pylist()
    members = [
        {"experiment": experiment, "order": order, "number": one["birth"],
         "rank": one["rank"], "parents": parents[order]}
        for order, one in zip(rows, known, strict=True)
    ]  # fmt: skip
    return pa.Table.from_pylist(members, LINEAGE)


def ordered(
    levels: Sequence[Sequence[int]], edges: Sequence[tuple[int, int]]
) -> list[list[int]]:
    """Return the levels, each sorted so that few lines cross.

    Sweeps upwards and downwards; each sweep sorts a level by the mean place of its
    members' relatives on the levels before it.

    Args:
        levels: from below.
        edges: (child, parent).

    Source: Sugiyama, Tagawa, Toda, *Methods for visual understanding of hierarchical
    system structures*, 1981; its barycentres.
    """
    relatives: dict[int, list[int]] = {one: [] for level in levels for one in level}
    for child, parent in edges:
        relatives[child].append(parent)
        relatives[parent].append(child)
    rows = [sorted(level) for level in levels]
    tried = []
    for _ in range(_SWEEPS):
        rows = _sweep(rows, relatives)
        tried.append(rows)
        rows = _sweep(rows[::-1], relatives, ties=-1)[::-1]
    return min(tried, key=lambda rows: _crossings(rows, edges))


def _sweep(
    rows: list[list[int]], relatives: dict[int, list[int]], ties: int = 1
) -> list[list[int]]:
    """Sort each row by the mean place of relatives in the rows before it.

    Members of a row with equal means keep their order, or reverse it (``ties`` -1).
    """
    place: dict[int, float] = {}
    found = []
    for row in rows:
        middles = {}
        for at, one in enumerate(row):
            near = [place[other] for other in relatives[one] if other in place]
            middles[one] = sum(near) / len(near) if near else (at + 0.5) / len(row)
        found.append(sorted(row[::ties], key=middles.__getitem__))
        place |= {one: (at + 0.5) / len(row) for at, one in enumerate(found[-1])}
    return found


def _crossings(rows: list[list[int]], edges: Sequence[tuple[int, int]]) -> int:
    """Return how many pairs of lines between the same two rows cross."""
    spot = {one: (level, at) for level, row in enumerate(rows) for at, one in
            enumerate(row)}  # fmt: skip
    lines = [(spot[child], spot[parent]) for child, parent in edges]
    return sum(
        a[0] == c[0] and b[0] == d[0] and (a[1] - c[1]) * (b[1] - d[1]) < 0
        for (a, b), (c, d) in combinations(lines, 2)
    )
