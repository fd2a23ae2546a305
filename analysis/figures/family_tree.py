"""The best robots, and whom they and their parts descend from."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import pyarrow as pa
import pyarrow.compute as pc

from analysis.measures.ancestry import ancestors, parents_first, parents_of
from analysis.measures.population_table import names, rows_of

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
    """A robot and the ancestors that are shown of it, as rows of the births table.

    Attributes:
        levels: who is how many steps of reproduction above it, itself first; each
            stands once, where it is nearest.
        edges: (child, parent) of those.
        founders: whose parts live on in any of them, by the number of parts.
        paint: founder of each gene that is a founder's.
    """

    levels: tuple[tuple[int, ...], ...]
    edges: tuple[tuple[int, int], ...]
    founders: tuple[int, ...]
    paint: dict[int, int]


def best_robots(robots: pa.Table) -> list[Best]:
    """Return the best robot of each experiment, by the experiment's name.

    Args:
        robots: as ``outputs`` names its columns; of equals the first counts.
    """
    found: dict[str, Best] = {}
    columns = ["experiment", "folder", "birth_island", "birth", "fitness"]
    last = robots.filter(pc.field("is_last")).select(columns)
    for row in last.to_pylist():
        known = found.get(row["experiment"])
        if known is None or row["fitness"] > known.fitness:
            one = Best(**{**row, "folder": Path(row["folder"])})
            found[one.experiment] = one
    return [found[name] for name in sorted(found)]


def row_of(best: Best, births: pa.Table) -> int:
    """Return the births row of a robot; -1 if its birth is not there."""
    named = pa.table({"birth_island": [best.birth_island], "birth": [best.birth]})
    return int(rows_of(names(named), births)[0])


def family(births: pa.Table, row: int, levels: int = LEVELS) -> Family:
    """Return the nearest ancestors of a robot, and the founders of their parts.

    Args:
        births: of its run.
        row: its row.
        levels: how many, its own included.

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
    paint = _founders(bodies, parents)
    counts: dict[int, int] = {}
    for member in sorted(known):
        for gene in bodies[member].values.field("gene").to_pylist():
            if gene in paint:
                counts[paint[gene]] = counts.get(paint[gene], 0) + 1
    return Family(
        tuple(map(tuple, shown)),
        tuple((down, up) for down, up in edges if up in known),
        tuple(sorted(counts, key=lambda one: (-counts[one], one))),
        paint,
    )


def _founders(bodies: pa.ListArray, parents: list[list[int]]) -> dict[int, int]:
    """Return who had a gene first, of genes that somebody without parents has."""
    paint: dict[int, int] = {}
    for row, couple in enumerate(parents):
        if not couple:
            for gene in bodies[row].values.field("gene").to_pylist():
                paint.setdefault(gene, row)
    return paint


def lineage(births: pa.Table, experiment: str, row: int) -> pa.Table:
    """Return a robot and all its ancestors, as ``LINEAGE``; itself last.

    Args:
        births: of its run.
        experiment: the run's.
        row: its row.
    """
    parents = parents_of(births)
    line = ancestors(parents)[row] | 1 << row
    rows = [order for order in parents_first(parents) if line >> order & 1]
    known = births.select(["birth", "rank"]).take(pa.array(rows)).to_pylist()
    people = [
        {"experiment": experiment, "order": order, "number": one["birth"],
         "rank": one["rank"], "parents": parents[order]}
        for order, one in zip(rows, known, strict=True)
    ]  # fmt: skip
    return pa.Table.from_pylist(people, LINEAGE)


def ordered(
    levels: Sequence[Sequence[int]], edges: Sequence[tuple[int, int]]
) -> list[list[int]]:
    """Return the levels so that few lines cross: each sorted by the one below.

    Args:
        levels: from below.
        edges: (child, parent).

    Source: Sugiyama, Tagawa, Toda, *Methods for visual understanding of hierarchical
    system structures*, 1981; its barycentres, one sweep.
    """
    place: dict[int, float] = {}
    found = []
    for level in levels:
        middles = {}
        for one in level:
            below = [place[down] for down, up in edges if up == one and down in place]
            middles[one] = sum(below) / len(below) if below else 0.0
        row = sorted(level, key=lambda one: (middles[one], one))
        place |= {one: (at + 0.5) / len(row) for at, one in enumerate(row)}
        found.append(row)
    return found
