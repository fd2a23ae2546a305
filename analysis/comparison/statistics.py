"""Effect sizes and tests of the difference between experiments; the unit is the run.

Experiments are compared by ranks, without assuming a distribution. Probabilities are
exact, also for few runs: SciPy's exact rank tests do not apply to tied values. Arrays
(N,) and (M,) hold one number per run of an experiment and of another one.

Equivalence is tested by two one-sided tests (TOST) at 5 %: both ends of a margin are
excluded, which is the same as a 90 % interval inside the margin. Source: Schuirmann, *A
comparison of the two one-sided tests procedure and the power approach*, J. Pharmacokin.
Biopharm. 15, 1987.
"""

import math
from bisect import bisect_left
from functools import lru_cache

import numpy as np
from scipy import optimize, stats

from analysis.measures.population_table import Numbers
from schema.robot.trees import Integers

ALPHA = 0.05
"""Probability to call experiments alike that differ by the margin."""
LEVEL = 0.95
"""Confidence level of all intervals."""
_Z = float(stats.norm.ppf((1 + LEVEL) / 2))
_POWER_Z = float(stats.norm.ppf(0.8))
EQUAL_RUNS = 10
"""Fewer equal runs than this do not show that there is no spread: ten show with 95 %
confidence that at most 26 % of all runs differ."""


def cliffs_delta(a: Numbers, b: Numbers) -> float:
    """Return Cliff's delta, P(a > b) - P(a < b), in [-1, 1].

    Source: Cliff, *Dominance statistics*, Psychological Bulletin 114(3), 1993.
    """
    return float(np.sign(a[:, None] - b[None, :]).mean())


def delta_interval(delta: float, first: int, second: int) -> tuple[float, float]:
    """Return the ends of the 95 % interval of Cliff's delta of N and M runs.

    Unlike a bootstrap interval, it does not shrink to a point if all runs of one
    experiment are above all runs of the other.

    Source: Newcombe, *Confidence intervals for an effect size measure based on the
    Mann-Whitney statistic*, part 2, method 5, Statistics in Medicine 25, 2006.
    """
    middle = (delta + 1) / 2

    def excess(theta: float) -> float:
        return (theta - middle) ** 2 - _Z**2 * score_variance(theta, first, second)

    # The excess is negative near the middle, and 0 at 0 and 1 if that is the middle.
    low = optimize.brentq(excess, 0.0, max(middle - 1e-9, 0.0))
    high = optimize.brentq(excess, min(middle + 1e-9, 1.0), 1.0)
    return 2 * float(low) - 1, 2 * float(high) - 1


def score_variance(theta: float, first: int, second: int) -> float:
    """Return the variance of (delta + 1) / 2 if its true value is ``theta``.

    Source: Newcombe, 2006, as for ``delta_interval``.
    """
    mean_runs = (first + second) / 2
    bracket = (1 - theta) / (2 - theta) + theta / (1 + theta)
    spread = theta * (1 - theta) * (1 + (mean_runs - 1) * bracket)
    return spread / (first * second)


def rank_sum_p(a: Numbers, b: Numbers) -> float:
    """Return the two-sided p of the Wilcoxon-Mann-Whitney test.

    It is the share of all ways to divide the N + M numbers, ties included, whose rank
    sum is at least as far from its mean.

    Source: Wilcoxon, 1945; Mann and Whitney, 1947; counted exactly.
    """
    places = _doubled_ranks(np.concatenate([a, b]))
    ways = rank_sum_ways(places, len(a))
    return _tails(ways, int(places[: len(a)].sum()))


def runs_needed(delta: float) -> int | None:
    """Return how many runs of each show an effect, four times in five.

    They are the fewest with which ``rank_sum_p`` is below 5 % with a probability of
    80 % if Cliff's delta is ``delta``; None if it is 0.

    Source: the normal approximation of Noether, *Sample size determination for some
    common nonparametric tests*, J. Am. Stat. Assoc. 82, 1987, with the variance of
    ``score_variance``.
    """
    if not delta:
        return None
    theta = (abs(delta) + 1) / 2

    def is_enough(runs: int) -> bool:
        unlike, alike = score_variance(theta, runs, runs), (2 * runs + 1) / 12 / runs**2
        reach = _Z * math.sqrt(alike) + _POWER_Z * math.sqrt(unlike)
        return theta - 0.5 >= reach and 2 / math.comb(2 * runs, runs) < ALPHA

    most = 9 + int(6 / delta**2)
    return bisect_left(range(most), True, lo=1, key=is_enough)


def rank_sum_ways(places: Integers, chosen: int) -> Numbers:
    """Return the number of ways to choose some doubled ranks, by the sum of these."""
    ways = np.zeros((chosen + 1, int(places.sum()) + 1))
    ways[0, 0] = 1.0
    for place in places.tolist():
        ways[1:, place:] += ways[:-1, :-place]
    found: Numbers = ways[chosen]
    return found


def signed_rank(values: Numbers) -> tuple[float, float]:
    """Return effect and p of Wilcoxon's signed-rank test of differences.

    The effect is the matched-pairs rank-biserial correlation, in [-1, 1]; p is
    two-sided, with ties. Zeros are ignored; 0 and 1 if there is nothing else.

    Source: Wilcoxon, 1945, counted exactly; Kerby, *The simple difference formula*,
    Comprehensive Psychology 3, 2014.
    """
    counted = values[values != 0]
    if not len(counted):
        return 0.0, 1.0
    places = _doubled_ranks(np.abs(counted))
    ways = np.zeros(int(places.sum()) + 1)
    ways[0] = 1.0
    for place in places.tolist():
        ways[place:] += ways[:-place].copy()
    above = int(places[counted > 0].sum())
    return 2 * above / int(places.sum()) - 1, _tails(ways, above)


def _doubled_ranks(values: Numbers) -> Integers:
    """Return twice the rank of each number; equal numbers share their mean."""
    return (2 * stats.rankdata(values)).astype(np.int64)


def _tails(ways: Numbers, found: int) -> float:
    """Return the share of sums at least as far from their mean as the one found."""
    sums = np.arange(len(ways))
    total = ways.sum()
    mean = float((ways * sums).sum() / total)
    is_far = np.abs(sums - mean) >= abs(found - mean) - 1e-6
    return min(1.0, float(ways[is_far].sum() / total))


def standard_error(values: Numbers) -> float:
    """Return the standard error of a mean; NaN if the spread over runs is unknown.

    It is for one run, and for fewer than ``EQUAL_RUNS`` that are all equal: those show
    how rare other values are, not that there are none.
    """
    # The deviation of equal numbers may be rounded to more than 0.
    if not np.ptp(values):
        return 0.0 if len(values) >= EQUAL_RUNS else math.nan
    return float(values.std(ddof=1)) / math.sqrt(len(values))


def mean(values: Numbers) -> float:
    """Return the mean of numbers; of equal ones exactly their value."""
    return float(np.clip(values.mean(), values.min(), values.max()))


def mean_difference(a: Numbers, b: Numbers | float) -> tuple[float, float, float]:
    """Return the difference of two means, and the ends of its 95 % interval.

    They are NaN where a spread is unknown. SciPy's intervals warn of nearly equal
    numbers, and have other rules for few runs. Instead of runs ``b`` may be a number.

    Source: Welch, *The generalization of Student's problem*, Biometrika 34, 1947.
    """
    samples = [x for x in (a, b) if isinstance(x, np.ndarray)]
    difference = mean(a) - mean(np.atleast_1d(b))
    parts = [standard_error(sample) ** 2 for sample in samples]
    total = sum(parts)
    if total == 0 or math.isnan(total):
        return difference, difference + total, difference + total
    freedom = total**2 / sum(
        part**2 / max(len(x) - 1, 1) for part, x in zip(parts, samples, strict=True)
    )
    half = float(stats.t.ppf((1 + LEVEL) / 2, freedom)) * math.sqrt(total)
    return difference, difference - half, difference + half


def median_interval(values: Numbers) -> tuple[float, float]:
    """Return the exact 95 % interval of a median; NaN for fewer than six runs."""
    exact = stats.quantile_test(values, p=0.5).confidence_interval(LEVEL)
    return float(exact.low), float(exact.high)  # type: ignore[attr-defined]


def half_interval(deviation: Numbers, runs: Integers) -> Numbers:
    """Return half the width of means' 95 % intervals, (G,); NaN for one run.

    The standard deviations over runs, (G,), are divided by the number of runs, as Arrow
    does.
    """
    freedom = np.where(runs > 1, runs - 1.0, np.nan)
    half: Numbers = stats.t.ppf((1 + LEVEL) / 2, freedom) * deviation / np.sqrt(freedom)
    return half


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
