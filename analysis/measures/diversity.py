"""Diversity: mean distance of the bodies of a population."""

import numpy as np
import pyarrow as pa

from analysis.measures.outputs import run_schema
from analysis.measures.population_table import (
    Numbers,
    PopulationTable,
    is_last_of_each,
)
from analysis.measures.trees import Integers, Trees

_BLOCK = 2_000_000
"""Pairs that are held in memory at a time."""


def diversity(table: PopulationTable, trees: Trees) -> Numbers:
    """Return the mean tree edit distance of the pairs of each population, (G,).

    All members count, mature or not, each unordered pair once. Brains are ignored.
    NaN for populations of less than two members.

    Args:
        table: populations of a run.
        trees: bodies of the run's births table, row by row.

    Source: Hupkes 2016, section 6.2.1 and figure 6.5.
    """
    found, sizes = np.full(len(table), np.nan), table.sizes
    for size in np.unique(sizes[sizes > 1]).tolist():
        first, second = np.triu_indices(size, 1)
        step = max(1, _BLOCK // len(first))
        every = np.flatnonzero(sizes == size)
        for begin in range(0, len(every), step):
            groups = every[begin : begin + step]
            rows = table.starts[groups][:, None] + np.arange(size)
            living = trees.tree_of[table.members[rows]]
            pairs = living[:, first].ravel(), living[:, second].ravel()
            distances = distances_of(trees, *pairs).reshape(len(groups), -1)
            found[groups] = distances.mean(axis=1)
    return found


def distances_of(trees: Trees, first: Integers, second: Integers) -> Integers:
    """Return the distances of pairs of trees, (P,); equal pairs are computed once.

    Args:
        trees: all trees.
        first: (P,) index of the first tree of each pair.
        second: (P,) index of the second.
    """
    # Numba takes 110 MB, which only the processes that measure need.
    from analysis.measures.distance import tree_distances  # noqa: PLC0415

    count = len(trees.starts)
    keys = np.minimum(first, second) * count + np.maximum(first, second)
    different, where = np.unique(keys, return_inverse=True)
    found: Integers = tree_distances(trees, *np.divmod(different, count))[where]
    return found


def mean_distances(table: PopulationTable, trees: Trees, step: int = 15) -> pa.Table:
    """Return the mean distances of bodies within and between islands.

    Args:
        table: populations of a run.
        trees: bodies of the run's births table, row by row.
        step: births on each island from one row to the next.

    Returns:
        One row per ``births``, ascending: ``islands`` that have a population so far
        (the latest of each is used), ``within`` (mean of their diversities) and
        ``between`` (mean distance of all pairs on different islands); null if there
        are no pairs.

    Source: own, after Hupkes 2016, section 6.2.1.
    """
    within = diversity(table, trees)
    rows = []
    for births in range(step, int(table.births.max(initial=0)) + 1, step):
        latest = _latest(table, births)
        is_shown = np.isin(table.group_of, latest)
        living = trees.tree_of[table.members[is_shown]]
        homes = table.group_of[is_shown]
        first, second = np.nonzero(homes[:, None] < homes)
        distances = distances_of(trees, living[first], living[second])
        known = within[latest][~np.isnan(within[latest])]
        rows.append(
            {
                "births": births,
                "islands": len(latest),
                "within": float(known.mean()) if len(known) else None,
                "between": float(distances.mean()) if len(distances) else None,
            }
        )
    return pa.Table.from_pylist(rows, run_schema("between"))


def _latest(table: PopulationTable, births: int) -> Integers:
    """Return each island's last population at or before a number of births."""
    before = np.flatnonzero(table.births <= births)
    latest: Integers = before[is_last_of_each(table.islands[before])]
    return latest
