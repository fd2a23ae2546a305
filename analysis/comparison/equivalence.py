"""Equivalence tests: whether a difference is smaller than a margin, and their power.

Two one-sided tests (TOST) at 5 %: both ends of the margin are excluded, which is the
same as a 90 % interval inside the margin. Source: Schuirmann, *A comparison of the two
one-sided tests procedure and the power approach*, J. Pharmacokin. Biopharm. 15, 1987.
"""

import math
from functools import lru_cache

import numpy as np
from scipy import stats

from analysis.comparison.statistics import (
    mean,
    rank_sum_ways,
    score_variance,
    standard_error,
)
from analysis.measures.population_table import Numbers

ALPHA = 0.05
"""Probability to call experiments alike that differ by the margin."""


def alike_p(delta: float, first: int, second: int, margin: float) -> float:
    """Return p of the test that Cliff's delta of N and M runs is within a margin.

    Source: score test, as the interval of ``statistics.delta_interval``.
    """
    end = (margin + 1) / 2
    error = math.sqrt(score_variance(end, first, second))
    return float(stats.norm.cdf((abs(delta) - margin) / 2 / error))


@lru_cache
def alike_power(first: int, second: int, margin: float, alpha: float = ALPHA) -> float:
    """Return how probably ``alike_p`` is at most ``alpha`` for one distribution.

    Counted exactly over all orders of N and M runs, without ties.
    """
    error = math.sqrt(score_variance((margin + 1) / 2, first, second))
    most = margin - 2 * stats.norm.ppf(1 - alpha) * error
    ways = rank_sum_ways(2 * np.arange(1, first + second + 1), first)
    # A doubled rank sum s is delta = (s - first (first + 1)) / (first second) - 1.
    delta = (np.arange(len(ways)) - first * (first + 1)) / (first * second) - 1
    return float(ways[np.abs(delta) <= most].sum() / ways.sum())


def mean_alike_p(values: Numbers, reference: float, margin: float) -> float:
    """Return p of the test that the mean of two or more runs is near a number.

    Source: Schuirmann, 1987, with Student's t.
    """
    room = margin - abs(mean(values) - reference)
    error = standard_error(values)
    if math.isnan(error):
        return 1.0
    if error == 0:
        return 0.0 if room > 0 else 1.0
    return float(stats.t.sf(room / error, len(values) - 1))


def mean_alike_power(values: Numbers, margin: float) -> float:
    """Return how probably ``mean_alike_p`` is below 5 % if the mean is the number.

    The spread over runs is taken as known from the runs.
    """
    error, freedom = standard_error(values), len(values) - 1
    if math.isnan(error):
        return 0.0
    if error == 0:
        return 1.0
    room = margin / error - stats.t.ppf(1 - ALPHA, freedom)
    return max(0.0, 1 - 2 * float(stats.t.sf(room, freedom)))
