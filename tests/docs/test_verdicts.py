"""Each verdict of docs/results.md is recomputed with SciPy from docs/data."""

import math
from functools import cache
from typing import Any

import numpy as np
import pandas as pd  # type: ignore[import-untyped]
import pyarrow.parquet as pq
import pytest
from scipy import optimize, stats

from analysis.comparison.claims import ARENA, CLAIMS, Claim
from analysis.measures.population_table import Numbers
from docs.studies.thesis.data import DATA
from docs.studies.thesis.parts import _short
from docs.studies.thesis.results import tables_of

Row = dict[str, Any]
FEW = 10
"""Fewer equal runs show no spread."""
DRAWS = 20000


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (-0.00001, "0"), (0.0, "0"), (-0.0, "0"), (-0.00006, "-0.0001"),
        (0.0123456, "0.0123"), (-12.344, "-12.3"), (-1234.5, "-1230"),
    ],
)  # fmt: skip
def test_short_numbers_have_no_negative_zero(value: float, text: str) -> None:
    assert _short(value) == text


@cache
def _rows(experiment: str) -> list[Row]:
    found = []
    for path in sorted((DATA / "outcomes").glob(f"{experiment}-[0-9][0-9].parquet")):
        populations = pq.read_table(DATA / "populations" / path.name).to_pandas()
        course = populations.set_index("births")
        for row in pq.read_table(path).to_pylist():
            end = row["births"]
            last, middle, first = (
                course.loc[until - 0.1 * end + 1 : until]
                for until in (end, end // 2, end // 10)
            )
            rise = last["fitness"].mean() - middle["fitness"].mean()
            early = first["diversity"].mean()
            found.append(row | {"late_rise": rise, "early_diversity": early})
            if end == max(course.index):
                found[-1] |= _of_best(experiment, row["run"], path.name)
    return found


def _of_best(experiment: str, run: int, file: str) -> Row:
    """Return outcomes of the best robot, and the slope of fitness by extremities."""
    robots = pd.read_csv(DATA / "windows" / "robots.csv")
    own = robots[(robots["experiment"] == experiment) & (robots["run"] == run)]
    bins = pd.read_parquet(DATA / "extremities" / file).dropna(subset="fitness")
    many = bins[(bins["by"] == "count") & (bins["population"] == "born")]
    many = many[many["bin"] >= 4]
    found: Row = {"extremities_slope": None}
    if len(many) > 1:
        weights = np.sqrt(many["robots"])
        slope, _ = np.polyfit(many["bin"], many["fitness"], 1, w=weights)
        found["extremities_slope"] = slope
    if own.empty:
        return found | dict.fromkeys(("later_fitness", "sustained", "kept_fitness"))
    first, *later = own.filter(regex="^window ").fillna(0.0).iloc[0]
    groups = [own.filter(regex=f"^{name}").mean(axis=1).iloc[0]
              for name in ("time step", "friction", "start")]  # fmt: skip
    is_positive = first > 0
    return found | {
        "later_fitness": np.mean(later),
        "sustained": np.mean(later) / first if is_positive else None,
        "kept_fitness": np.mean(groups) / first if is_positive else None,
    }


def _values(experiment: str, measure: str, births: int) -> Numbers:
    if experiment == ARENA:
        path = DATA / "bench" / "arena.parquet"
        rows = pq.read_table(path).to_pylist() if path.exists() else []
        return np.array([row["factor"] for row in rows if row["population"] == 30])
    rows = (row for row in _rows(experiment) if row["births"] == births)
    found = [row.get(measure) for row in rows]
    return np.array([value for value in found if value is not None], np.float64)


def _births(experiments: list[str]) -> int:
    """Return the most births of which each run of the experiments has a row."""
    if ARENA in experiments:
        return 0
    reached: dict[tuple[str, int], set[int]] = {}
    for name in experiments:
        for row in _rows(name):
            reached.setdefault((name, row["run"]), set()).add(row["births"])
    return max(set.intersection(*reached.values())) if reached else 0


def _score_error(theta: float, n: int, m: int) -> float:
    """Return the standard error of P(a > b) + P(a = b) / 2 (Newcombe 2006, eq. 5)."""
    inner = 1 + ((n + m) / 2 - 1) * ((1 - theta) / (2 - theta) + theta / (1 + theta))
    return math.sqrt(theta * (1 - theta) * inner / (n * m))


def _delta_ends(theta: float, n: int, m: int) -> tuple[float, float]:
    z = stats.norm.ppf(0.975)

    def gap(x: float) -> float:
        return (x - theta) ** 2 - (z * _score_error(x, n, m)) ** 2

    near = 1e-9
    low = optimize.brentq(gap, 0, theta - near) if theta > near else 0.0
    high = optimize.brentq(gap, theta + near, 1) if theta < 1 - near else 1.0
    return 2 * low - 1, 2 * high - 1


def _shuffled_p(places: Numbers, chosen: int) -> float:
    """Return p of the sum of the first places, by random permutations."""
    rng = np.random.default_rng(1)
    sums = rng.permuted(np.tile(places, (DRAWS, 1)), axis=1)[:, :chosen].sum(axis=1)
    away = abs(places[:chosen].sum() - places.mean() * chosen)
    return float(np.mean(np.abs(sums - places.mean() * chosen) >= away - 1e-9))


def _signed_p(places: Numbers, above: float) -> float:
    """Return p of the sum of the places above, by random signs."""
    rng = np.random.default_rng(1)
    sums = rng.integers(0, 2, (DRAWS, len(places))) @ places
    middle = places.sum() / 2
    return float(np.mean(np.abs(sums - middle) >= abs(above - middle) - 1e-9))


def _of_two(claim: Claim, a: Numbers, b: Numbers) -> Row:
    is_tied = len(np.unique([*a, *b])) < len(a) + len(b)
    n, m = len(a), len(b)
    exact = stats.mannwhitneyu(a, b, method="exact")
    places = stats.rankdata([*a, *b])
    p = _shuffled_p(places, n) if is_tied else float(exact.pvalue)
    theta = float(exact.statistic) / (n * m)
    row: Row = {"p": p, "effect": 2 * theta - 1, "rough": is_tied}
    row["ends"] = _delta_ends(theta, n, m)
    row["margin"] = 0.474 if claim.expected == "=" else 0.147
    upper = (1 + row["margin"]) / 2
    sides = ((upper - theta), theta - (1 - upper))
    row["alike"] = max(
        stats.norm.sf(side / _score_error(upper, n, m)) for side in sides
    )
    row["size"] = row["effect"]
    return row


def _of_one(claim: Claim, a: Numbers) -> Row:
    away = a - claim.reference
    sizes = np.abs(away[away != 0])
    is_tied = len(np.unique(sizes)) < len(away)
    places = stats.rankdata(sizes)
    above = places[away[away != 0] > 0].sum()
    if is_tied:
        p = _signed_p(places, above)
    else:
        p = float(stats.wilcoxon(away, method="exact").pvalue)
    effect = 2 * above / places.sum() - 1 if len(sizes) else 0.0
    ends = (away.mean(), away.mean())
    sides = [0.0 if abs(away.mean()) < claim.margin else 1.0]
    if not np.ptp(away) and len(away) < FEW:
        ends, sides = (None, None), [1.0]
    if np.ptp(away) > 0:
        ends = stats.ttest_1samp(away, 0).confidence_interval(0.95)
        sides = [
            float(stats.ttest_1samp(away, -claim.margin, alternative="greater").pvalue),
            float(stats.ttest_1samp(away, claim.margin, alternative="less").pvalue),
        ]
    return {"p": p, "effect": effect, "rough": is_tied, "ends": tuple(ends),
            "margin": claim.margin, "alike": max(sides),
            "size": away.mean()}  # fmt: skip


def _recomputed(claim: Claim) -> Row:
    """Return the numbers of a claim, or only its verdict."""
    names = [claim.a] + ([claim.b] if claim.b else [])
    births = _births(names)
    found = [_values(name, claim.measure, births) for name in names]
    if not all(len(_rows(name)) or name == ARENA for name in names):
        return {"verdict": "undecided"}
    if births < claim.births:
        return {"verdict": "does not apply"}
    if min(map(len, found)) < 2:
        return {"verdict": "undecided"}
    if claim.is_spread:
        found = [np.abs(values - np.median(values)) for values in found]
    if claim.expected == "some":
        occurs = (found[0] > 0).any()
        is_rare = stats.binomtest(0, len(found[0]), alternative="less")
        high = is_rare.proportion_ci(0.95, "exact").high
        none = "not reproduced" if high < 0.1 else "undecided"
        return {"verdict": "reproduced" if occurs else none}
    if claim.b is None:
        return _of_one(claim, found[0])
    return _of_two(claim, found[0], found[1] * claim.share)


def _verdict(claim: Claim, row: Row) -> str:
    low, high = (math.nan if end is None else end for end in row["ends"])
    is_sure, margin = row["q"] < 0.05, row["margin"]
    if claim.expected == "=":
        if row["q_alike"] < 0.05:
            return "reproduced"
        is_apart = low * high > 0 and abs(row["size"]) >= margin
        return "not reproduced" if is_apart and is_sure else "undecided"
    if claim.expected == "!=":
        inside = -margin < low and high < margin
        other = "not reproduced" if inside else "undecided"
        return "reproduced" if is_sure else other
    if claim.expected == "<":
        low, high = -high, -low
        row = row | {"effect": -row["effect"]}
    if high < margin:
        return "not reproduced"
    if not is_sure:
        return "undecided"
    return "reproduced" if row["effect"] > 0 else "not reproduced"


def test_every_verdict_is_recomputed_with_scipy() -> None:
    ours = tables_of(DATA)["findings"].to_pylist()
    found = [_recomputed(claim) for claim in CLAIMS]
    tested = [row for row in found if "p" in row]
    q = stats.false_discovery_control([row["p"] for row in tested])
    for row, value in zip(tested, q, strict=True):
        row["q"] = float(value)
    alike = [
        row
        for claim, row in zip(CLAIMS, found, strict=True)
        if claim.expected == "=" and "p" in row
    ]
    q = stats.false_discovery_control([row["alike"] for row in alike])
    for row, value in zip(alike, q, strict=True):
        row["q_alike"] = float(value)
    for claim, mine, row in zip(CLAIMS, ours, found, strict=True):
        assert mine["claim"] == claim.text
        if "p" not in row:
            assert mine["verdict"] == row["verdict"], claim.text
            continue
        assert mine["effect"] == pytest.approx(row["effect"], abs=1e-9), claim.text
        ends = "effect" if claim.b else "difference"
        known = mine[f"{ends}_low"], mine[f"{ends}_high"]
        assert known == pytest.approx(row["ends"], abs=1e-4), claim.text
        if claim.expected == "=":
            assert mine["p_alike"] == pytest.approx(row["alike"], abs=1e-6), claim.text
        # Random permutations approximate the distribution of tied ranks.
        error = 0.02 if row["rough"] else 1e-9
        assert mine["p"] == pytest.approx(row["p"], abs=error), claim.text
        if not 0.04 < row["q"] < 0.06:
            assert mine["verdict"] == _verdict(claim, row), claim.text


def test_outcomes_are_those_of_the_last_robots() -> None:
    for path in sorted((DATA / "final").iterdir()):
        robots = pq.read_table(path)
        rows = pq.read_table(DATA / "outcomes" / path.name).to_pylist()
        last = max(rows, key=lambda row: int(row["births"]))
        for name in ("fitness", "parts", "passive_joints", "hidden", "rank"):
            mean = np.mean(robots[name].to_numpy())
            assert last[name] == pytest.approx(mean, rel=1e-9), (path.name, name)
        touch = np.asarray(robots["touch_sensors"])
        shares = [np.mean(touch == 0), np.mean(touch == 1), np.mean(touch > 1)]
        names = ("without_touch", "one_touch", "two_touch")
        assert [last[name] for name in names] == pytest.approx(shares)
