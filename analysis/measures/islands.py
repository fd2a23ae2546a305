"""Runs of several islands: distances between these, and descendants of migrants."""

import numpy as np
import pyarrow as pa

from analysis.measures.diversity.distances import distances_of, diversity
from analysis.measures.outputs import run_schema
from analysis.measures.population_table import individual_ids, is_last_of_each, rows_of
from analysis.measures.run_tables import RunTables


def mean_distances(run: RunTables, step: int = 15) -> pa.Table:
    """Return the mean distances of bodies within and between islands.

    Each row is about the latest population of each island that has one after ``step``
    births, twice as many, and so on; null if there are no pairs.

    Source: own, after Hupkes 2016, section 6.2.1.
    """
    table, trees = run.population_table, run.trees
    within = diversity(table, trees)
    rows = []
    for births in range(step, int(table.births.max(initial=0)) + 1, step):
        before = np.flatnonzero(table.births <= births)
        latest = before[is_last_of_each(table.islands[before])]
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


def migrants(run: RunTables) -> pa.Table:
    """Return the descendants of each migrant, one row per migration, in order.

    Source: own.
    """
    table, births = run.population_table, run.births
    is_last = table.is_last[table.group_of]
    members = table.members[is_last]
    where = table.islands[table.group_of][is_last]
    homes = np.asarray(births["island"], np.int64)
    moved = run.tables["migrations"].to_pylist()
    rows = rows_of(individual_ids(run.tables["migrations"]), births).tolist()
    for row, migrant in zip(rows, moved, strict=True):
        line = np.array([row >= 0 and up >> row & 1 for up in run.lines], np.bool_)
        is_own = line[members] | (members == row)
        migrant["descendants"] = int((line & (homes == migrant["to"])).sum())
        migrant["living"] = int((is_own & (where == migrant["to"])).sum())
        migrant["reached"] = len(np.unique(where[is_own]))
    return pa.Table.from_pylist(moved, run_schema("migrants"))
