"""Tests of the findings of the thesis, and their verdicts."""

from collections.abc import Callable, Sequence

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc

from analysis.comparison.claims import ARENA, CLAIMS, Claim
from analysis.comparison.comparison import (
    OF_FITNESS,
    Outcomes,
    Row,
    RunOutcomes,
    correct,
    one_sample,
    two_samples,
)
from analysis.comparison.statistics import (
    alike_p,
    alike_power,
    mean_alike_p,
    mean_alike_power,
)
from analysis.measures.outputs import schema
from analysis.measures.population_table import Numbers

SURE = 0.05
"""Greatest corrected p of a verdict."""
NEGLIGIBLE, LARGE = 0.147, 0.474
"""Bounds of Cliff's delta: the largest negligible effect, and the least large one.

"Alike" means no large effect. Source: Romano et al., 2006, after Cohen's d.
"""
RARE = 0.1
"""Share of runs below which something is said not to occur."""
ARENA_ROBOTS = 30
"""Robots of the arena whose speed is tested."""


def with_benchmark(outcomes: Outcomes, benchmark: pa.Table) -> Outcomes:
    """Return outcomes with the speed of an arena as an experiment of its own.

    Each repetition, a row of ``revolve bench arena --out``, is a run.
    """
    is_of = (pc.field("benchmark") == "arena") & (
        pc.field("population") == ARENA_ROBOTS
    )
    factors = benchmark.filter(is_of)["factor"].to_pylist()
    speeds = [RunOutcomes("", "", (0,), _speed(factor)) for factor in factors]
    return Outcomes({**outcomes.runs, **({ARENA: speeds} if speeds else {})})


def _speed(factor: float) -> Callable[[int], dict[str, float]]:
    return lambda _: {"real_time_factor": factor}


def findings(outcomes: Outcomes, claims: Sequence[Claim] = CLAIMS) -> pa.Table:
    """Return the test of each finding of the thesis, one row per claim, in order.

    Claims about experiments without finished runs are undecided.
    """
    rows = [_tested(outcomes, claim) for claim in claims]
    correct(rows)
    correct(rows, "p_alike", "q_alike")
    for number, (claim, row) in enumerate(zip(claims, rows, strict=True), 1):
        row |= {
            "finding": number,
            "figure": claim.figure,
            "claim": claim.text,
            "topic": claim.topic or claim.text,
            "measure": claim.measure,
            "a": claim.a,
            "b": claim.b or "",
            "expected": claim.expected,
            "near_automatic": claim.is_automatic,
        }
        if "why" not in row:
            row["verdict"], row["why"] = verdict(claim.expected, row)
    return pa.Table.from_pylist(rows, schema("findings"))


def _tested(outcomes: Outcomes, claim: Claim) -> Row:
    """Return the numbers of a claim, or the reason why it cannot be tested."""
    names = [name for name in (claim.a, claim.b) if name is not None]
    for name in names:
        if name not in outcomes.experiments:
            return _undecided(f"no finished run of {name} could be measured")
    functions = outcomes.fitness_functions(*names)
    if claim.measure in OF_FITNESS and len(functions) > 1:
        return _undecided(f"different fitness functions: {', '.join(functions)}")
    births = outcomes.births(*names)
    if births < claim.births:
        why = f"means something from {claim.births} births on"
        return {"births": births, "verdict": "does not apply", "why": why}
    samples = [outcomes.values(name, claim.measure, births) for name in names]
    if min(map(len, samples)) <= 1:
        return {"births": births, **_undecided("less than two runs have a value")}
    if claim.b is None:
        return {"births": births, **_against_number(samples[0], claim)}
    a, b = samples
    return {"births": births, **_against_experiment(a, b, claim)}


def _undecided(why: str) -> Row:
    return {"verdict": "undecided", "why": why}


def _against_number(a: Numbers, claim: Claim) -> Row:
    row = one_sample(a, claim.reference) | {"margin": claim.margin}
    if claim.expected == "=":
        row["p_alike"] = mean_alike_p(a, claim.reference, claim.margin)
        row["power"] = mean_alike_power(a, claim.margin)
    elif claim.expected == "some":
        row |= {"effect": float((a > 0).mean()), "p": None, "margin": None}
    return row


def _against_experiment(a: Numbers, b: Numbers, claim: Claim) -> Row:
    compared = (_distances(a), _distances(b)) if claim.is_spread else (a, b)
    row = two_samples(compared[0], claim.share * compared[1])
    if claim.expected != "=":
        return row | {"margin": NEGLIGIBLE}
    p = alike_p(row["effect"], len(a), len(b), LARGE)
    power = alike_power(len(a), len(b), LARGE)
    return row | {"margin": LARGE, "p_alike": p, "power": power}


def _distances(values: Numbers) -> Numbers:
    """Return the distances of runs from their median, (N,)."""
    distances: Numbers = np.abs(values - np.median(values))
    return distances


def verdict(expected: str, row: Row) -> tuple[str, str]:
    """Return whether a finding is reproduced, and the rule of the verdict.

    Args:
        expected: as ``Claim.expected``.
        row: ``effect``, ``q``, ``margin``; the ends of the interval of the effect, or
            of the difference where an experiment is compared with a number (unknown
            ends are as far apart as possible); with "=", ``q_alike``; with "some",
            ``runs_a`` and ``effect``, the share of runs.
    """
    if expected == "some":
        return _some(row)
    is_of_two = row.get("runs_b") is not None
    name, of = ("effect", "") if is_of_two else ("difference", " of the difference")
    low, high = _end(row, f"{name}_low", -1), _end(row, f"{name}_high", 1)
    margin = row["margin"]
    if expected == "=":
        return _alike(row, (low, high), row[name])
    if expected == "!=":
        return _different(row, max(abs(low), abs(high)))
    sign = 1 if expected == ">" else -1
    if max(sign * low, sign * high) < margin:
        why = (
            f"the 95 % interval{of} (uncorrected) ends below {margin:g}: the effect in "
            "the expected direction is at most negligible"
        )
        return "not reproduced", why
    return _directed(row, sign)


def _directed(row: Row, sign: int) -> tuple[str, str]:
    if row["q"] >= SURE:
        return "undecided", f"q >= {SURE}: no significant difference"
    if row["effect"] * sign > 0:
        return "reproduced", f"q < {SURE}, and the effect is as expected"
    return "not reproduced", f"q < {SURE}, and the effect has the opposite sign"


def _end(row: Row, name: str, sign: int) -> float:
    value = row.get(name)
    return sign * float("inf") if value is None else float(value)


def _alike(row: Row, ends: tuple[float, float], found: float) -> tuple[str, str]:
    margin = row["margin"]
    if row["q_alike"] < SURE:
        return "reproduced", f"two one-sided tests: within +-{margin:g}, q < {SURE}"
    low, high = ends
    if (low > 0 or high < 0) and abs(found) >= margin and row["q"] < SURE:
        return "not reproduced", f"q < {SURE}, and the estimate is beyond +-{margin:g}"
    return "undecided", f"shown neither to be within +-{margin:g} nor to be beyond"


def _different(row: Row, most: float) -> tuple[str, str]:
    if row["q"] < SURE:
        return "reproduced", f"q < {SURE}"
    if most < row["margin"]:
        return "not reproduced", f"the interval is within +-{row['margin']:g}"
    return "undecided", f"q >= {SURE}: no significant difference"


def _some(row: Row) -> tuple[str, str]:
    if row["effect"] > 0:
        return "reproduced", "it occurs"
    most = 1 - SURE ** (1 / row["runs_a"])
    if most < RARE:
        return "not reproduced", f"in no run; with 95 % certainty in less than {RARE:g}"
    return "undecided", f"in no run, but possibly in {most:.2f} of them"
