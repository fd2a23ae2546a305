"""The best robots, their ancestors, and the founders of their parts."""

import math
from collections import Counter
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
        founder_of: first founder that has a gene, by gene.
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
    columns = ["experiment", "folder", "birth_island", "birth", "fitness"]
    last = robots.filter(pc.field("is_last")).select(columns)
    fittest = last.sort_by([("experiment", "ascending"), ("fitness", "descending")])
    found: dict[str, Best] = {}
    for row in fittest.to_pylist():
        row["folder"] = Path(row["folder"])
        found.setdefault(row["experiment"], Best(**row))
    return list(found.values())


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

    def genes(member: int) -> list[int]:
        # 0 is no identity.
        return list(filter(None, bodies[member].values.field("gene").to_pylist()))

    founder_of: dict[int, int] = {}
    for founder in (row for row, couple in enumerate(parents) if not couple):
        for gene in genes(founder):
            founder_of.setdefault(gene, founder)
    inherited = [gene for member in known for gene in genes(member)]
    counts = Counter(founder_of[gene] for gene in inherited if gene in founder_of)
    return Family(
        tuple(map(tuple, shown)),
        tuple((down, up) for down, up in edges if up in known),
        tuple(sorted(counts, key=lambda founder: (-counts[founder], founder))),
        founder_of,
    )


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
    known = births.take(pa.array(rows))
    names = [experiment] * len(rows)
    above = [parents[order] for order in rows]
    columns = [names, rows, known["birth"], known["rank"], above]
    return pa.table(dict(zip(LINEAGE.names, columns, strict=True)), LINEAGE)


def ordered(
    levels: Sequence[Sequence[int]], edges: Sequence[tuple[int, int]]
) -> list[list[int]]:
    """Return the levels, each sorted so that few lines cross and lines are short.

    Each level is sorted by the mean place of its members' children; then two members
    of a level are exchanged as long as that improves the drawing.

    Args:
        levels: from below.
        edges: (child, parent).

    Source: Sugiyama, Tagawa, Toda, *Methods for visual understanding of hierarchical
    system structures*, 1981, for the first step; exchanges: own.
    """
    place: dict[int, float] = {}
    rows = []
    for level in levels:
        middles = {}
        for one in level:
            below = [place[down] for down, up in edges if up == one and down in place]
            middles[one] = sum(below) / len(below) if below else 0.0
        row = sorted(level, key=lambda one: (middles[one], one))
        place |= {one: (at + 0.5) / len(row) for at, one in enumerate(row)}
        rows.append(row)
    best, previous = _cost(rows, edges), math.inf
    while best < previous:
        previous = best
        for row in rows:
            for i, j in combinations(range(len(row)), 2):
                row[i], row[j] = row[j], row[i]
                cost = _cost(rows, edges)
                if cost < best:
                    best = cost
                else:
                    row[i], row[j] = row[j], row[i]
    return rows


def _cost(rows: list[list[int]], edges: Sequence[tuple[int, int]]) -> float:
    """Return the number of crossings plus the horizontal length of all lines."""
    spot = {
        one: (level, (at + 0.5) / len(row))
        for level, row in enumerate(rows)
        for at, one in enumerate(row)
    }
    lines = [(spot[child], spot[parent]) for child, parent in edges]
    crossings = sum(
        a[0] == c[0] and b[0] == d[0] and (a[1] - c[1]) * (b[1] - d[1]) < 0
        for (a, b), (c, d) in combinations(lines, 2)
    )
    length = sum(abs(child[1] - parent[1]) for child, parent in lines)
    return crossings + round(length, 9)
