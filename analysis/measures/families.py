"""Families of the best robots: nearest ancestors, and the founders of their parts."""

from collections import Counter
from dataclasses import dataclass
from itertools import chain

import numpy as np
import pyarrow as pa

from analysis.measures.ancestry import parents_of
from analysis.measures.diversity.distances import distances_of
from analysis.measures.outputs import run_schema
from analysis.measures.run_tables import RunTables
from schema.robot.trees import Integers, Trees

LEVELS = 5
"""Levels of reproduction of a family, the robot's own included."""
FOUNDERS = 15
"""Number of founders in the thesis's experiments."""


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


def family(births: pa.Table, row: int, levels: int = LEVELS) -> Family:
    """Return the nearest ancestors of a births row, and the founders of their parts.

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


def families(run: RunTables) -> pa.Table:
    """Return the family of the fittest robot of each island's last population.

    Founders are the robots without parents among the first 15 of the island. Null where
    there are no pairs, or no genes.

    Source: Hupkes 2016, figures 6.18 to 6.20; measures: own.
    """
    table, births = run.population_table, run.births
    birth = np.asarray(births["birth"], np.int64)
    home = np.asarray(births["island"], np.int64)
    has_parents = np.array([bool(couple) for couple in run.parents], np.bool_)
    rows = []
    for group in np.flatnonzero(table.is_last).tolist():
        living = table.living[group]
        fitness = table.fitness[living]
        if np.isnan(fitness).all():
            continue
        best = int(table.members[living][np.nanargmax(fitness)])
        found = family(births, best)
        island = int(table.islands[group])
        first = (home == island) & (birth < FOUNDERS) & ~has_parents
        members = np.array(list(chain.from_iterable(found.levels)), np.int64)
        rows.append(
            {
                "island": island,
                "births": int(table.births[group]),
                "birth_island": int(home[best]),
                "birth": int(birth[best]),
                "members": len(members),
                "distance": _mean_distance(run.trees, members),
                "founder_distance": _mean_distance(run.trees, np.flatnonzero(first)),
                "founders": len(found.founders) or None,
            }
        )
    return pa.Table.from_pylist(rows, run_schema("families"))


def _mean_distance(trees: Trees, rows: Integers) -> float | None:
    """Return the mean distance of the pairs of some bodies; None without pairs."""
    first, second = np.triu_indices(len(rows), 1)
    if not len(first):
        return None
    living = trees.tree_of[rows]
    return float(distances_of(trees, living[first], living[second]).mean())
