"""Diversity: mean distance of the bodies of a population."""

import numpy as np

from analysis.measures.population_table import Numbers, PopulationTable
from schema.robot.trees import Integers, Trees

_BLOCK = 2_000_000
"""Pairs that are held in memory at a time."""


def diversity(table: PopulationTable, trees: Trees) -> Numbers:
    """Return the mean tree edit distance of the pairs of each population, (G,).

    All members count, mature or not, each unordered pair once. Brains are ignored.
    NaN for populations of less than two members.

    Source: Hupkes 2016, section 6.2.1 and figure 6.5.
    """
    means, sizes = np.full(len(table), np.nan), table.sizes
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
            means[groups] = distances.mean(axis=1)
    return means


def distances_of(trees: Trees, first: Integers, second: Integers) -> Integers:
    """Return ``tree_distances`` of pairs, (P,); equal pairs are computed once."""
    # Numba takes 110 MB, which only the processes that measure need.
    from schema.robot.body_distance import tree_distances  # noqa: PLC0415

    count = len(trees.starts)
    keys = np.minimum(first, second) * count + np.maximum(first, second)
    different, where = np.unique(keys, return_inverse=True)
    distances: Integers = tree_distances(trees, *np.divmod(different, count))[where]
    return distances
