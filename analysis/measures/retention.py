"""How long individuals stay."""

import numpy as np

from analysis.measures.population_table import Numbers, PopulationTable

STEP = 120
"""Births between two looks: eight generations of fifteen, as in the thesis."""


def retention(population_table: PopulationTable, step: int = STEP) -> Numbers:
    """Return the share of each population that is still alive later, (G,).

    All the living count, mature or not. NaN where no population of the island is
    recorded so many births later: such a number of births is skipped.

    Args:
        population_table: of a run.
        step: births later.

    Source: Hupkes 2016, table 6.2 and figure 6.7.
    """
    # Island, births, individual; as one number each, smaller than 2^63.
    numbers = population_table.births.astype(np.int64)
    width = int(population_table.members.max(initial=0)) + 1
    height = int(numbers.max(initial=0)) + step + 1
    group = population_table.group_of
    base = population_table.islands * height + numbers
    now = base[group] * width + population_table.members
    later = (base[group] + step) * width + population_table.members
    remains = population_table.mean(np.isin(later, now).astype(np.float64))
    return np.where(np.isin(base + step, base), remains, np.nan)
