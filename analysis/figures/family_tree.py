"""The best robots, all their ancestors, and the order of a family tree."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, fields
from itertools import combinations
from pathlib import Path

import pyarrow as pa
import pyarrow.compute as pc

from analysis.measures.ancestry import ancestors, parents_first, parents_of
from analysis.measures.population_table import individual_ids, rows_of
from schema.errors import RunFolderError
from schema.tables.last_populations import Row, best_of

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
    """The fittest robot of the last populations of an experiment's runs.

    ``island`` is the one on which it had this fitness.
    """

    experiment: str
    folder: Path
    island: int
    birth_island: int
    birth: int
    fitness: float


def best_robots(robots: pa.Table) -> list[Best]:
    """Return the best robot of each experiment, sorted by the experiment's name.

    They are compared as at the end of a run; one whose evaluation failed is none.
    """
    is_judged = pc.field("is_last") & pc.invert(pc.field("is_failed"))
    last = robots.filter(is_judged).select([field.name for field in fields(Best)])
    experiments: dict[str, list[Row]] = {}
    for row in last.to_pylist():
        experiments.setdefault(row["experiment"], []).append(row)
    best = (best_of(experiments[name]) for name in sorted(experiments))
    return [Best(**{**row, "folder": Path(row["folder"])}) for row in best if row]


def row_of(best: Best, births: pa.Table) -> int:
    """Return the births row of a robot.

    Raises:
        RunFolderError: its birth is not recorded.
    """
    named = pa.table({"birth_island": [best.birth_island], "birth": [best.birth]})
    row = int(rows_of(individual_ids(named), births)[0])
    if row < 0:
        raise RunFolderError(f"{best.folder}: birth {best.birth} is not recorded")
    return row


def lineage(births: pa.Table, experiment: str, row: int) -> pa.Table:
    """Return row ``row`` of births and all its ancestors as ``LINEAGE``; it is last."""
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

    Each level, from below, is sorted by the mean place of its members' children; then
    two members of a level are exchanged as long as that improves the drawing.

    Source: Sugiyama, Tagawa, Toda, *Methods for visual understanding of hierarchical
    system structures*, 1981, for the first step; exchanges: own.
    """
    place: dict[int, float] = {}
    rows = []
    for level in levels:
        middles = {}
        for robot in level:
            below = [place[down] for down, up in edges if up == robot and down in place]
            middles[robot] = sum(below) / len(below) if below else 0.0
        row = sorted(level, key=lambda robot: (middles[robot], robot))
        place |= {robot: (at + 0.5) / len(row) for at, robot in enumerate(row)}
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
        robot: (level, (at + 0.5) / len(row))
        for level, row in enumerate(rows)
        for at, robot in enumerate(row)
    }
    lines = [(spot[child], spot[parent]) for child, parent in edges]
    crossings = sum(
        a[0] == c[0] and b[0] == d[0] and (a[1] - c[1]) * (b[1] - d[1]) < 0
        for (a, b), (c, d) in combinations(lines, 2)
    )
    length = sum(abs(child[1] - parent[1]) for child, parent in lines)
    return crossings + round(length, 9)
