"""Comparison of experiments with each other, and with the findings of the thesis.

Fitness is compared only between experiments with the same fitness function: numbers of
different meanings have no difference.

The unit is the run. Runs of different experiments with the same seed and number share
their founders; treating them as independent, as is done here, is conservative.
"""

import math
from collections.abc import Mapping, Sequence
from itertools import combinations
from typing import Any, Protocol

import numpy as np
import pyarrow as pa

from analysis.comparison.claims import CLAIMS, Claim
from analysis.comparison.outcomes import outcome
from analysis.comparison.statistics import (
    cliffs_delta,
    delta_interval,
    false_discovery,
    mean_difference,
    rank_sum_p,
    signed_rank,
)
from analysis.measures.outputs import OUTCOME, schema
from analysis.measures.population_table import Numbers
from analysis.measures.study import MeasuredRun, reach

SURE = 0.05
NEGLIGIBLE, LARGE = 0.147, 0.474
"""Bounds of Cliff's delta. Source: Romano et al., 2006, after Cohen's d."""
OF_FITNESS = frozenset({"fitness", "fitness_best", "late_gain", "variability"})
"""Measures whose values depend on the scale of the fitness function."""

Row = dict[str, Any]


class RunOutcomes(Protocol):
    """Outcomes of the finished runs of experiments."""

    @property
    def experiments(self) -> list[str]:
        """Experiments with finished runs, by name."""

    def births(self, *experiments: str) -> int:
        """Return the most births that all runs of some experiments reach."""

    def values(self, experiment: str, measure: str, births: int) -> Numbers:
        """Return the runs' values of a measure; runs without a value are skipped."""

    def fitness_functions(self, *experiments: str) -> list[str]:
        """Return the fitness functions of experiments, each once."""


class Outcomes:
    """Outcomes of finished runs, at any number of births; other runs are ignored."""

    def __init__(self, measured: Sequence[MeasuredRun]) -> None:
        self._runs: dict[str, list[MeasuredRun]] = {}
        for one in measured:
            if one.run.is_finished and reach(one):
                self._runs.setdefault(one.run.experiment, []).append(one)
        self._known: dict[tuple[str, int], list[dict[str, float]]] = {}

    @property
    def experiments(self) -> list[str]:
        """Experiments with finished runs, by name."""
        return sorted(self._runs)

    def births(self, *experiments: str) -> int:
        """Return the most births that all runs of some experiments reach."""
        return min(reach(one) for name in experiments for one in self._runs[name])

    def at(self, experiment: str, births: int) -> list[dict[str, float]]:
        """Return each run's outcomes at a number of births, in the runs' order."""
        key, runs = (experiment, births), self._runs[experiment]
        if key not in self._known:
            self._known[key] = [outcome(one.tables, births) for one in runs]
        return self._known[key]

    def values(self, experiment: str, measure: str, births: int) -> Numbers:
        """Return the runs' values of a measure; runs without a value are skipped."""
        runs = self.at(experiment, births)
        found = np.array([run.get(measure, math.nan) for run in runs])
        known: Numbers = found[~np.isnan(found)]
        return known

    def fitness_functions(self, *experiments: str) -> list[str]:
        """Return the fitness functions of experiments, each once."""
        runs = (one.run for name in experiments for one in self._runs[name])
        return list(dict.fromkeys(run.fitness for run in runs))

    def table(self) -> pa.Table:
        """Return the outcomes of all finished runs, at births that all reach."""
        rows: list[Row] = []
        for name in self.experiments:
            births = self.births(name)
            for one, found in zip(self._runs[name], self.at(name, births), strict=True):
                numbers: Row = {key: _known(value) for key, value in found.items()}
                names = {"experiment": name, "folder": str(one.run.folder)}
                rows.append(numbers | names | {"births": births})
        return pa.Table.from_pylist(rows, schema("outcomes"))


def comparison(outcomes: RunOutcomes) -> pa.Table:
    """Return the comparison of every pair of experiments by every measure.

    Args:
        outcomes: outcomes of finished runs.

    Returns:
        One row per measure and pair for which both experiments have values, with the
        columns of ``outputs``. Pairs with different fitness functions have no rows of
        the measures ``OF_FITNESS``.
    """
    rows = []
    for a, b in combinations(outcomes.experiments, 2):
        births = outcomes.births(a, b)
        is_alike = len(outcomes.fitness_functions(a, b)) == 1
        for measure in OUTCOME:
            if measure in OF_FITNESS and not is_alike:
                continue
            samples = [outcomes.values(name, measure, births) for name in (a, b)]
            if measure != "births" and all(map(len, samples)):
                named = {"measure": measure, "a": a, "b": b, "births": births}
                rows.append({**named, **_two_samples(*samples)})
    return pa.Table.from_pylist(_corrected(rows), schema("comparison"))


def findings(outcomes: RunOutcomes, claims: Sequence[Claim] = CLAIMS) -> pa.Table:
    """Return the test of each finding of the thesis.

    Args:
        outcomes: outcomes of finished runs.
        claims: the findings.

    Returns:
        One row per claim, in order, with the columns of ``outputs``; claims about
        experiments without finished runs are undecided.
    """
    rows = [_tested(outcomes, claim) for claim in claims]
    tested = [row for row in rows if row.get("p") is not None]
    _corrected(tested)
    for number, (claim, row) in enumerate(zip(claims, rows, strict=True), 1):
        row |= {
            "finding": number,
            "figure": claim.figure,
            "claim": claim.text,
            "measure": claim.measure,
            "a": claim.a,
            "b": claim.b or "",
            "expected": claim.expected,
        }
        if "why" not in row:
            row["verdict"], row["why"] = verdict(claim.expected, row)
    return pa.Table.from_pylist(rows, schema("findings"))


def _tested(outcomes: RunOutcomes, claim: Claim) -> Row:
    """Return the numbers of a claim, or the reason why it cannot be tested."""
    names = [name for name in (claim.a, claim.b) if name is not None]
    for name in names:
        if name not in outcomes.experiments:
            why = f"no finished run of {name} could be measured"
            return {"verdict": "undecided", "why": why}
    functions = outcomes.fitness_functions(*names)
    if claim.measure in OF_FITNESS and len(functions) > 1:
        why = f"different fitness functions: {', '.join(functions)}"
        return {"verdict": "undecided", "why": why}
    births = outcomes.births(*names)
    samples = [outcomes.values(name, claim.measure, births) for name in names]
    if min(map(len, samples)) <= 1:
        why = "less than two runs have a value"
        return {"births": births, "verdict": "undecided", "why": why}
    if claim.b is None:
        return {"births": births, **_one_sample(samples[0], claim.reference)}
    return {"births": births, **_two_samples(*samples)}


def _two_samples(a: Numbers, b: Numbers) -> Row:
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


def _one_sample(a: Numbers, reference: float) -> Row:
    effect, p = signed_rank(a - reference)
    return {**_described(a, np.array([reference])), "effect": effect, "p": p}


def _described(a: Numbers, b: Numbers) -> Row:
    difference, low, high = mean_difference(a, b)
    return {
        "runs_a": len(a),
        "mean_a": float(a.mean()),
        "mean_b": float(b.mean()),
        "median_a": float(np.median(a)),
        "median_b": float(np.median(b)),
        "difference": difference,
        "difference_low": _known(low),
        "difference_high": _known(high),
    }


def _known(value: float) -> float | None:
    return None if math.isnan(value) else value


def _corrected(rows: list[Row]) -> list[Row]:
    """Write ``q`` into rows that have a ``p``, and return them."""
    p = np.array([row["p"] for row in rows], np.float64)
    for row, q in zip(rows, false_discovery(p).tolist(), strict=True):
        row["q"] = q
    return rows


def verdict(expected: str, row: Mapping[str, Any]) -> tuple[str, str]:
    """Return whether a finding is reproduced, and the rule of the verdict.

    Args:
        expected: ">" or "<" for the side of a, "=" for no large difference.
        row: ``effect``, ``q`` and, for two experiments, the effect's interval.
    """
    effect, q = row["effect"], row["q"]
    # Unknown ends are as far apart as possible.
    ends = row.get("effect_low", -1.0), row.get("effect_high", 1.0)
    if expected == "=":
        return _alike(effect, q, ends)
    sign = 1 if expected == ">" else -1
    if q < SURE:
        if effect * sign > 0:
            return "reproduced", f"q < {SURE}, and the effect is as expected"
        return "not reproduced", f"q < {SURE}, and the effect has the opposite sign"
    if max(sign * end for end in ends) < NEGLIGIBLE:
        why = f"at most negligible as expected: the interval ends below {NEGLIGIBLE}"
        return "not reproduced", why
    return "undecided", f"q >= {SURE}: no significant difference"


def _alike(effect: float, q: float, ends: tuple[float, float]) -> tuple[str, str]:
    if max(map(abs, ends)) < LARGE:
        return "reproduced", f"no large effect: the interval is within +-{LARGE}"
    if q < SURE and abs(effect) >= LARGE:
        return "not reproduced", f"q < {SURE}, and the effect is large"
    return "undecided", f"the interval reaches beyond +-{LARGE}, or q >= {SURE}"
