"""Tests of the findings of the thesis."""

from collections.abc import Callable, Sequence

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc

from analysis.comparison.claims import ARENA, CLAIMS, Claim
from analysis.comparison.comparison import OF_FITNESS, Outcomes, RunOutcomes
from analysis.comparison.equivalence import (
    alike_p,
    alike_power,
    mean_alike_p,
    mean_alike_power,
)
from analysis.comparison.samples import Row, correct, one_sample, two_samples
from analysis.comparison.verdicts import LARGE, NEGLIGIBLE, verdict
from analysis.measures.outputs import schema
from analysis.measures.population_table import Numbers

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
