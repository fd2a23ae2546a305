"""Comparison of experiments with each other.

Fitness is compared only between experiments with the same fitness function: numbers of
different meanings have no difference.

The unit is the run. Runs of different experiments with the same seed and number share
their founders; treating them as independent, as is done here, is conservative.
"""

import math
from collections.abc import Callable, Collection, Mapping, Sequence
from functools import partial
from itertools import combinations
from typing import Any, NamedTuple

import numpy as np
import pyarrow as pa
from scipy import stats

from analysis.comparison.outcomes import outcome
from analysis.comparison.statistics import (
    cliffs_delta,
    delta_interval,
    mean,
    mean_difference,
    rank_sum_p,
    runs_needed,
    signed_rank,
)
from analysis.measures.outputs import OUTCOME, OWN, schema
from analysis.measures.population_table import Numbers
from analysis.measures.study import MeasuredRun, reach
from schema.experiment.grid import Grid

Row = dict[str, Any]

OF_FITNESS = frozenset({
    "fitness", "fitness_best", "late_gain", "late_rise", "variability", "gain",
    "qd_score", "hypervolume", "later_fitness",
    "extremities_slope",
})  # fmt: skip
"""Measures whose values depend on the scale of the fitness function."""
OF_GRID = frozenset({
    "coverage", "qd_score", "archive_entropy", "hypervolume", "novelty",
})  # fmt: skip
"""Measures whose values depend on the grid."""


class RunOutcomes(NamedTuple):
    """Outcomes of one finished run.

    Attributes:
        folder: path of the run folder.
        fitness: fitness function as ``fitness_text``.
        births: numbers of births at which it has outcomes.
        at: returns the outcomes at one of these, by measure.
        grid: cells over measures.
    """

    folder: str
    fitness: str
    births: Collection[int]
    at: Callable[[int], Mapping[str, float]]
    grid: Grid | None = None


class Outcomes:
    """Outcomes of the finished runs of experiments, at least one of each."""

    def __init__(self, runs: Mapping[str, Sequence[RunOutcomes]]) -> None:
        self.runs = runs
        self._known: dict[tuple[str, int], list[Mapping[str, float]]] = {}

    @property
    def experiments(self) -> list[str]:
        """Experiments with finished runs, by name."""
        return sorted(self.runs)

    def births(self, *experiments: str) -> int:
        """Return the most births at which all runs of some experiments have outcomes.

        0 if there are none.
        """
        each = [set(run.births) for name in experiments for run in self.runs[name]]
        return max(set.intersection(*each), default=0)

    def at(self, experiment: str, births: int) -> list[Mapping[str, float]]:
        """Return each run's outcomes at a number of births, in the runs' order."""
        key = (experiment, births)
        if key not in self._known:
            runs = self.runs[experiment]
            self._known[key] = [run.at(births) for run in runs if births in run.births]
        return self._known[key]

    def values(self, experiment: str, measure: str, births: int) -> Numbers:
        """Return the runs' values of a measure; runs without a value are skipped."""
        runs = self.at(experiment, births)
        every = np.array([run.get(measure, math.nan) for run in runs], np.float64)
        values: Numbers = every[~np.isnan(every)]
        return values

    def own_measures(self, births: int, *experiments: str) -> list[str]:
        """Return the outcomes that are measures named by experiments, by name."""
        runs = (run for name in experiments for run in self.at(name, births))
        return sorted({key for run in runs for key in run if key.startswith(OWN)})

    def fitness_functions(self, *experiments: str) -> list[str]:
        """Return the fitness functions of experiments, each once."""
        runs = (run for name in experiments for run in self.runs[name])
        return list(dict.fromkeys(run.fitness for run in runs))

    def table(self) -> pa.Table:
        """Return the outcomes of all finished runs, at births that all reach."""
        rows: list[Row] = []
        for name in self.experiments:
            births = self.births(name)
            pairs = zip(self.runs[name], self.at(name, births), strict=True)
            for run, values in pairs:
                numbers: Row = {key: known(value) for key, value in values.items()}
                names = {"experiment": name, "folder": run.folder, "births": births}
                rows.append(numbers | names)
        return pa.Table.from_pylist(rows, schema("outcomes"))


def outcomes_of(measured: Sequence[MeasuredRun]) -> Outcomes:
    """Return the outcomes of measured runs; those of unfinished runs are ignored."""
    runs: dict[str, list[RunOutcomes]] = {}
    for one in measured:
        if one.run.is_finished and (end := reach(one)):
            at = partial(outcome, one.tables, settings=one.run.islands)
            grid = one.run.settings.grid
            made = RunOutcomes(
                str(one.run.folder), one.run.fitness, range(end + 1), at, grid
            )
            runs.setdefault(one.run.experiment, []).append(made)
    return Outcomes(runs)


def comparison(outcomes: Outcomes) -> pa.Table:
    """Return the comparison of every pair of experiments by every measure.

    Pairs with different fitness functions have no rows of the measures ``OF_FITNESS``,
    those with different grids none of ``OF_GRID``.
    A measure that is equal in all runs of both is no test: it has no p, and does not
    count for the correction of the others.
    """
    rows = []
    for a, b in combinations(outcomes.experiments, 2):
        births = outcomes.births(a, b)
        is_alike = len(outcomes.fitness_functions(a, b)) == 1
        unlike = frozenset() if is_alike else OF_FITNESS
        grids = {run.grid for run in (*outcomes.runs[a], *outcomes.runs[b])}
        unlike |= frozenset() if len(grids) == 1 else OF_GRID
        for measure in (*OUTCOME, *outcomes.own_measures(births, a, b)):
            if measure in unlike:
                continue
            samples = [outcomes.values(name, measure, births) for name in (a, b)]
            if measure != "births" and all(map(len, samples)):
                named = {"measure": measure, "a": a, "b": b, "births": births}
                row = {**named, **two_samples(*samples)}
                row["runs_needed"] = runs_needed(row["effect"])
                if not np.ptp(np.concatenate(samples)):
                    row["p"] = None
                rows.append(row)
    return pa.Table.from_pylist(correct(rows), schema("comparison"))


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
