"""Comparison of experiments with each other.

Fitness is compared only between experiments with the same fitness function: numbers of
different meanings have no difference.

The unit is the run. Runs of different experiments with the same seed and number share
their founders; treating them as independent, as is done here, is conservative.
"""

import math
from collections.abc import Sequence
from itertools import combinations
from typing import Protocol

import numpy as np
import pyarrow as pa

from analysis.comparison.outcomes import outcome
from analysis.comparison.samples import Row, correct, known, two_samples
from analysis.measures.outputs import OUTCOME, OWN, schema
from analysis.measures.population_table import Numbers
from analysis.measures.study import MeasuredRun, reach

OF_FITNESS = frozenset({
    "fitness", "fitness_best", "late_gain", "late_rise", "variability", "gain",
})  # fmt: skip
"""Measures whose values depend on the scale of the fitness function."""


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


class Compared(RunOutcomes, Protocol):
    """Outcomes of experiments that may name measures of their own."""

    def own_measures(self, births: int, *experiments: str) -> list[str]:
        """Return the outcomes that are measures named by experiments, by name."""


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
            self._known[key] = [
                outcome(one.tables, births, one.run.islands) for one in runs
            ]
        return self._known[key]

    def values(self, experiment: str, measure: str, births: int) -> Numbers:
        """Return the runs' values of a measure; runs without a value are skipped."""
        runs = self.at(experiment, births)
        found = np.array([run.get(measure, math.nan) for run in runs])
        values: Numbers = found[~np.isnan(found)]
        return values

    def own_measures(self, births: int, *experiments: str) -> list[str]:
        """Return the outcomes that are measures named by experiments, by name."""
        runs = (run for name in experiments for run in self.at(name, births))
        return sorted({key for run in runs for key in run if key.startswith(OWN)})

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
                numbers: Row = {key: known(value) for key, value in found.items()}
                names = {"experiment": name, "folder": str(one.run.folder)}
                rows.append(numbers | names | {"births": births})
        return pa.Table.from_pylist(rows, schema("outcomes"))


def comparison(outcomes: Compared) -> pa.Table:
    """Return the comparison of every pair of experiments by every measure.

    Args:
        outcomes: outcomes of finished runs.

    Returns:
        One row per measure and pair for which both experiments have values, with the
        columns of ``outputs``. Pairs with different fitness functions have no rows of
        the measures ``OF_FITNESS``. A measure that is equal in all runs of both is no
        test: it has no p, and does not count for the correction of the others.
    """
    rows = []
    for a, b in combinations(outcomes.experiments, 2):
        births = outcomes.births(a, b)
        is_alike = len(outcomes.fitness_functions(a, b)) == 1
        for measure in (*OUTCOME, *outcomes.own_measures(births, a, b)):
            if measure in OF_FITNESS and not is_alike:
                continue
            samples = [outcomes.values(name, measure, births) for name in (a, b)]
            if measure != "births" and all(map(len, samples)):
                named = {"measure": measure, "a": a, "b": b, "births": births}
                row = {**named, **two_samples(*samples)}
                if not np.ptp(np.concatenate(samples)):
                    row["p"] = None
                rows.append(row)
    return pa.Table.from_pylist(correct(rows), schema("comparison"))
