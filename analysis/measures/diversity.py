"""How different the bodies of a population are from each other."""

from collections.abc import Iterator

import numpy as np
import pyarrow as pa

from analysis.measures.distance import tree_distances
from analysis.measures.population_table import Numbers, PopulationTable
from analysis.measures.trees import Integers, Trees

_BLOCK = 2_000_000
"""Pairs that are held at a time."""


def diversity(population_table: PopulationTable, trees: Trees) -> Numbers:
    """Return the mean tree edit distance of the pairs of each population, (G,).

    All the living count, mature or not, each unordered pair once; brains do not.
    NaN where less than two live.

    Args:
        population_table: of a run.
        trees: of the bodies of the run's births table, row by row.

    Source: Hupkes 2016, section 6.2.1 and figure 6.5.
    """
    found = np.full(len(population_table), np.nan)
    for groups, first, second in _pairs(population_table, trees):
        distances = distances_of(trees, first.ravel(), second.ravel())
        found[groups] = distances.reshape(first.shape).mean(axis=1)
    return found


def _pairs(
    population_table: PopulationTable, trees: Trees
) -> Iterator[tuple[Integers, Integers, Integers]]:
    """Yield populations of one size, and the trees of all their pairs, (g, pairs)."""
    sizes = population_table.sizes
    for size in np.unique(sizes[sizes > 1]).tolist():
        first, second = np.triu_indices(size, 1)
        step = max(1, _BLOCK // len(first))
        every = np.flatnonzero(sizes == size)
        for begin in range(0, len(every), step):
            groups = every[begin : begin + step]
            rows = population_table.starts[groups][:, None] + np.arange(size)
            living = trees.tree_of[population_table.members[rows]]
            yield groups, living[:, first], living[:, second]


def distances_of(trees: Trees, first: Integers, second: Integers) -> Integers:
    """Return the distances of pairs of trees, each different pair computed once, (P,).

    Args:
        trees: that the numbers stand for.
        first: (P,) numbers of trees.
        second: (P,) the others.
    """
    count = len(trees.starts)
    keys = np.minimum(first, second) * count + np.maximum(first, second)
    different, where = np.unique(keys, return_inverse=True)
    found: Integers = tree_distances(trees, *np.divmod(different, count))[where]
    return found


def mean_distances(
    population_table: PopulationTable, trees: Trees, step: int = 15
) -> pa.Table:
    """Return how different the bodies of islands are, within and between them.

    Args:
        population_table: of a run.
        trees: of the bodies of its births table, row by row.
        step: births on each island from one row to the next.

    Returns:
        One row per ``births``, ascending: ``islands`` that have a population by then
        (each one's latest counts), ``within`` (mean of their diversities) and
        ``between`` (mean distance of all pairs of different islands); null where
        there is none.

    Source: own, after Hupkes 2016, section 6.2.1.
    """
    within = diversity(population_table, trees)
    rows = []
    last = int(population_table.births.max(initial=0))
    for births in range(step, last + 1, step):
        latest = _latest(population_table, births)
        living = [
            trees.tree_of[
                population_table.members[
                    population_table.starts[g] : population_table.starts[g + 1]
                ]
            ]
            for g in latest
        ]
        grids = [
            np.meshgrid(one, other, indexing="ij")
            for index, one in enumerate(living)
            for other in living[index + 1 :]
        ]
        between = None
        if grids:
            first, second = (
                np.concatenate([grid[side].ravel() for grid in grids])
                for side in (0, 1)
            )
            between = float(distances_of(trees, first, second).mean())
        known = within[latest][~np.isnan(within[latest])]
        rows.append(
            {
                "births": births,
                "islands": len(latest),
                "within": float(known.mean()) if len(known) else None,
                "between": between,
            }
        )
    kinds = [pa.int64(), pa.int64(), pa.float64(), pa.float64()]
    names = ["births", "islands", "within", "between"]
    return pa.Table.from_pylist(rows, pa.schema(list(zip(names, kinds, strict=True))))


def _latest(population_table: PopulationTable, births: int) -> Integers:
    """Return each island's last population at or before so many births."""
    before = np.flatnonzero(population_table.births <= births)
    islands = population_table.islands[before]
    is_last = np.append(islands[1:] != islands[:-1], True)[: len(islands)]
    latest: Integers = before[is_last]
    return latest
