"""Where migrants went, and what became of their descendants."""

import numpy as np
import pyarrow as pa

from analysis.measures.ancestry import descends
from analysis.measures.population_table import PopulationTable, names, rows_of


def migrants(
    migrations: pa.Table,
    births: pa.Table,
    population_table: PopulationTable,
    lines: list[int],
) -> pa.Table:
    """Return how far each migrant's descendants have spread.

    Args:
        migrations: of one run: ``epoch``, ``birth_island`` and ``birth`` (the migrant's
            name), ``island`` (it left), ``to``, ``fitness`` [m/s].
        births: of the same run: ``island``, ``birth``.
        population_table: of the same run.
        lines: as ``analysis.measures.ancestry.ancestors`` returns them.

    Returns:
        One row per migration, in order: its columns, ``descendants`` (born on the
        island it went to), ``living`` (of that island's last population, itself
        included) and ``reached`` (islands in whose last population it or a descendant
        lives).

    Source: own.
    """
    is_last = population_table.is_last[population_table.group_of]
    members = population_table.members[is_last]
    where = population_table.islands[population_table.group_of][is_last]
    homes = np.asarray(births["island"], np.int64)
    named = ("epoch", "birth_island", "birth", "island", "to", "fitness")
    table = migrations.select(named)
    counts: dict[str, list[int]] = {"descendants": [], "living": [], "reached": []}
    rows = rows_of(names(table), births)
    for row, to in zip(rows.tolist(), table["to"].to_pylist(), strict=True):
        line = descends(lines, row) if row >= 0 else np.zeros(len(lines), np.bool_)
        is_own = line[members] | (members == row)
        counts["descendants"].append(int((line & (homes == to)).sum()))
        counts["living"].append(int((is_own & (where == to)).sum()))
        counts["reached"].append(len(np.unique(where[is_own])))
    for name, column in counts.items():
        table = table.append_column(name, pa.array(column, pa.int64()))
    return table
