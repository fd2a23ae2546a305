"""Tests of equivalence tests against SciPy, intervals and simulated runs."""

import numpy as np
import pytest
from scipy import stats

from analysis.comparison.equivalence import (
    alike_p,
    alike_power,
    mean_alike_p,
    mean_alike_power,
)
from analysis.comparison.statistics import cliffs_delta, delta_interval

MARGIN = 0.474


def test_p_of_the_95_percent_interval_is_a_fortieth() -> None:
    """The interval of delta ends at the margin where one side has p = 0.025."""
    for delta in np.linspace(-0.5, 0.5, 7):
        for end in delta_interval(delta, 15, 25):
            if end * delta >= 0 and abs(end) > abs(delta):
                assert alike_p(delta, 15, 25, abs(end)) == pytest.approx(0.025)


def test_power_is_the_share_of_equal_experiments_called_alike() -> None:
    rng = np.random.default_rng(2)
    for first, second in ((10, 10), (30, 12), (30, 30)):
        calls = [
            alike_p(
                cliffs_delta(rng.normal(size=first), rng.normal(size=second)),
                first,
                second,
                MARGIN,
            )
            < 0.05
            for _ in range(2000)
        ]
        power = alike_power(first, second, MARGIN)
        assert np.mean(calls) == pytest.approx(power, abs=0.04)
    assert alike_power(5, 5, MARGIN) == 0


def test_few_equal_runs_show_nothing() -> None:
    for equal in (np.full(9, 1.5), np.full(3, 0.7), np.full(6, 0.7)):
        assert mean_alike_p(equal, equal[0], 0.8) == 1
        assert mean_alike_power(equal, 0.8) == 0


def test_mean_power_grows_with_the_margin_and_the_runs() -> None:
    values = np.random.default_rng(5).normal(0, 1, 30)
    powers = [mean_alike_power(values, margin) for margin in (0.1, 0.4, 0.6, 2.0)]
    assert powers[0] == 0
    assert powers == sorted(powers)
    assert powers[-1] == pytest.approx(1)
    # 2 P(t < 0.6 / error - t95) - 1 with t of 29 degrees of freedom.
    error = values.std(ddof=1) / np.sqrt(30)
    t = stats.t(29)
    expected = 2 * t.cdf(0.6 / error - t.ppf(0.95)) - 1
    assert powers[2] == pytest.approx(expected)
