"""How long individuals stay."""

import numpy as np

from analysis.measures.populations_table import Census, Numbers

STEP = 120
"""Births between two looks: eight generations of fifteen, as in the thesis."""


def retention(census: Census, step: int = STEP) -> Numbers:
    """Return the share of each population that is still alive later, (G,).

    All the living count, mature or not. NaN where no population of the island is
    recorded so many births later: such a number of births is skipped.

    Args:
        census: of a run.
        step: births later.

    Source: Hupkes 2016, table 6.2 and figure 6.7.
    """
    # Island, births, individual; as one number each, smaller than 2^63.
    numbers = census.births.astype(np.int64)
    width = int(census.members.max(initial=0)) + 1
    height = int(numbers.max(initial=0)) + step + 1
    group = census.group_of
    base = census.islands * height + numbers
    now = base[group] * width + census.members
    later = (base[group] + step) * width + census.members
    remains = census.mean(np.isin(later, now).astype(np.float64))
    return np.where(np.isin(base + step, base), remains, np.nan)
