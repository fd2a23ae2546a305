"""Tests of statistics against SciPy, and against enumeration for few runs."""

import math
from itertools import combinations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import stats

from analysis.comparison.statistics import (
    EQUAL_RUNS,
    alike_p,
    alike_power,
    cliffs_delta,
    delta_interval,
    mean_alike_p,
    mean_alike_power,
    mean_difference,
    median_interval,
    rank_sum_p,
    runs_needed,
    signed_rank,
    standard_error,
)
from analysis.measures.population_table import Numbers


def numbers(*values: float) -> Numbers:
    return np.array(values, np.float64)


# Few different values, so that many are tied.
samples = st.lists(st.integers(-4, 4), min_size=2, max_size=7)


@given(samples, samples)
def test_rank_sum_with_ties_equals_enumeration(a: list[int], b: list[int]) -> None:
    both = numbers(*a, *b)
    places = stats.rankdata(both)
    found = places[: len(a)].sum()
    mean = len(a) * (len(both) + 1) / 2
    sums = [sum(dealt) for dealt in combinations(places.tolist(), len(a))]
    far = [abs(each - mean) >= abs(found - mean) - 1e-9 for each in sums]
    expected = sum(far) / len(far)
    assert rank_sum_p(numbers(*a), numbers(*b)) == pytest.approx(expected)


def test_signed_rank_by_hand() -> None:
    # Ranks 1, 2, 3 of which 2 and 3 are above: (5 - 1) / 6; sums 0, 1, 5, 6 of the 8
    # possible are as far from 3 as 5 is.
    effect, p = signed_rank(numbers(-1, 2, 3))
    assert effect == pytest.approx(4 / 6)
    assert p == pytest.approx(4 / 8)
    assert signed_rank(numbers(0, 0)) == (0, 1)
    assert signed_rank(numbers(*range(1, 11)))[1] == pytest.approx(2 / 1024)


def test_difference_of_means_equals_scipy() -> None:
    rng = np.random.default_rng(6)
    a, b = rng.normal(1, 1, 10), rng.normal(0, 3, 5)
    expected = stats.ttest_ind(a, b, equal_var=False).confidence_interval()
    assert mean_difference(a, b) == pytest.approx(
        (a.mean() - b.mean(), expected.low, expected.high), rel=1e-9
    )
    # Against a reference: the interval of one mean.
    alone = stats.ttest_1samp(a, 0.5).confidence_interval()
    _, low, high = mean_difference(a, 0.5)
    assert (low + 0.5, high + 0.5) == pytest.approx((alone.low, alone.high), rel=1e-9)


@pytest.mark.parametrize("count", [6, 7, 9, 10, 30])
def test_median_interval_by_signs(count: int) -> None:
    values = numbers(*np.random.default_rng(count).permutation(count) + 1)
    low, high = median_interval(values)
    # So many values, of as many coins, may lie beyond each end.
    beyond = int(low) - 1
    ways = [sum(math.comb(count, k) for k in range(most + 1)) / 2**count
            for most in (beyond, beyond + 1)]  # fmt: skip
    assert ways[0] <= 0.025 < ways[1]
    assert high == count - beyond
    assert np.isnan(median_interval(values[:5])).all()


@pytest.mark.parametrize("turns", [1, -1])
@pytest.mark.parametrize("few", [numbers(3), numbers(3, 3), np.full(9, 3.0)])
def test_one_run_or_few_equal_ones_have_no_interval(few: Numbers, turns: int) -> None:
    difference, low, high = mean_difference(*(few, numbers(1, 2))[::turns])
    assert difference == turns * 1.5
    assert math.isnan(low)
    assert math.isnan(high)


def test_ten_equal_runs_have_no_spread() -> None:
    assert mean_difference(np.full(10, 3.0), 1.0) == (2.0, 2.0, 2.0)
    assert math.isnan(mean_difference(np.full(9, 3.0), 1.0)[1])
    # Ten equal runs of ten have a probability of 5 % if 26 % of all runs differ.
    assert (1 - 0.26) ** EQUAL_RUNS < 0.05 < (1 - 0.25) ** EQUAL_RUNS


@pytest.mark.parametrize("count", [3, 6, 7, 10])
@pytest.mark.parametrize("value", [0.05, 0.1, 0.7, 14 / 15, 1.4])
def test_equal_runs_have_no_spread_by_rounding(value: float, count: int) -> None:
    """The mean of three times 0.1 is rounded, so that their deviation is not 0."""
    error = standard_error(np.full(count, value))
    assert error == 0 if count >= EQUAL_RUNS else math.isnan(error)


def test_experiments_of_equal_runs_do_not_differ_by_rounding() -> None:
    """The mean of twelve times 0.1 is rounded, that of ten times is not."""
    same = mean_difference(np.full(10, 0.1), np.full(12, 0.1))
    assert same == (0.0, 0.0, 0.0)


@pytest.mark.slow
def test_interval_of_delta_has_the_stated_coverage() -> None:
    # Normal runs, one experiment half a deviation above: delta is known.
    rng = np.random.default_rng(7)
    truth = 2 * stats.norm.cdf(0.5 / math.sqrt(2)) - 1
    inside = 0
    for _ in range(600):
        a, b = rng.normal(0.5, 1, 10), rng.normal(0, 1, 10)
        low, high = delta_interval(cliffs_delta(a, b), 10, 10)
        inside += low <= truth <= high
    assert 0.93 <= inside / 600 <= 0.98


@pytest.mark.slow
@pytest.mark.parametrize(("delta", "runs"), [(0.4, 32), (0.6, 14), (0.8, 7), (0.9, 5)])
def test_an_effect_is_shown_four_times_in_five_by_the_runs_it_needs(
    delta: float, runs: int
) -> None:
    """The tests are SciPy's, of normal runs with this Cliff's delta."""
    assert runs_needed(delta) == runs_needed(-delta) == runs
    shift = math.sqrt(2) * stats.norm.ppf((delta + 1) / 2)
    rng = np.random.default_rng(7)
    shares = []
    for count in (runs, runs - 2):
        a, b = rng.normal(shift, 1, (3000, count)), rng.normal(0, 1, (3000, count))
        p = stats.mannwhitneyu(a, b, axis=1, method="exact").pvalue
        shares.append(float((p < 0.05).mean()))
    assert shares[1] < 0.79 < shares[0] < 0.86


def test_few_runs_show_no_effect_however_large() -> None:
    # Of three and three runs the least p is 0.1; no runs show an effect of 0.
    assert (runs_needed(1.0), runs_needed(0.0)) == (4, None)
    # Noether's formula, (1.96 + 0.842)^2 / (3 (delta / 2)^2) runs of both.
    assert runs_needed(0.02) == pytest.approx(2.8016**2 / 3 / 0.01**2 / 2, rel=1e-3)


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
