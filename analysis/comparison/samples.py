"""Rows of numbers that compare samples of runs."""

import math
from typing import Any

import numpy as np
from scipy import stats

from analysis.comparison.statistics import (
    cliffs_delta,
    delta_interval,
    mean,
    mean_difference,
    rank_sum_p,
    signed_rank,
)
from analysis.measures.population_table import Numbers

Row = dict[str, Any]


def two_samples(a: Numbers, b: Numbers) -> Row:
    """Return means, effect with interval, and p of two experiments."""
    delta = cliffs_delta(a, b)
    low, high = delta_interval(delta, len(a), len(b))
    return {
        **_described(a, b),
        "runs_b": len(b),
        "effect": delta,
        "effect_low": low,
        "effect_high": high,
        "p": rank_sum_p(a, b),
    }


def one_sample(a: Numbers, reference: float) -> Row:
    """Return means, effect and p of an experiment and a number."""
    effect, p = signed_rank(a - reference)
    return {**_described(a, reference), "effect": effect, "p": p}


def _described(a: Numbers, b: Numbers | float) -> Row:
    """Return sizes, means and medians of an experiment and another one or a number."""
    difference, low, high = mean_difference(a, b)
    return {
        "runs_a": len(a),
        "mean_a": mean(a),
        "mean_b": mean(np.atleast_1d(b)),
        "median_a": float(np.median(a)),
        "median_b": float(np.median(b)),
        "difference": difference,
        "difference_low": known(low),
        "difference_high": known(high),
    }


def known(value: float) -> float | None:
    """Return a number, None for NaN."""
    return None if math.isnan(value) else value


def correct(rows: list[Row], p: str = "p", q: str = "q") -> list[Row]:
    """Write the corrected p values of rows that have one, and return all rows.

    At most 5 % of the tests with a corrected value below 0.05 are expected to be
    false discoveries.

    Source: Benjamini and Hochberg, *Controlling the false discovery rate*, J. R.
    Statist. Soc. B 57(1), 1995.
    """
    tested = [row for row in rows if row.get(p) is not None]
    values = np.array([row[p] for row in tested], np.float64)
    corrected = stats.false_discovery_control(values)
    for row, value in zip(tested, corrected.tolist(), strict=True):
        row[q] = value
    return rows
