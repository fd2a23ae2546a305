"""All measures of one run, as tables.

Everything is a function of the run's own tables. A measure that needs a damaged table
is left out, with the reason; all others are measured.
"""

from collections.abc import Callable
from operator import attrgetter
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
import pyarrow as pa
import pyarrow.compute as pc

from analysis.measures.arenas import interactions, last_samples, variability
from analysis.measures.bodies import extremity_bins
from analysis.measures.diversity.grids import cells
from analysis.measures.diversity.objectives import fronts, objectives_of
from analysis.measures.ecosystems import (
    birth_places,
    couples,
    life_courses,
    lifespans,
    patch_means,
)
from analysis.measures.families import families
from analysis.measures.islands import mean_distances, migrants
from analysis.measures.learning import learning, learning_curves
from analysis.measures.load import has_rules, island_settings, records_touches
from analysis.measures.named_measures import named_measures
from analysis.measures.population_table import (
    Booleans,
    Numbers,
    individual_ids,
    is_last_of_each,
    last_there,
    residence_ids,
    rows_of,
)
from analysis.measures.populations import populations
from analysis.measures.run_tables import Problems, RunTables
from analysis.measures.season_changes import season_changes
from analysis.measures.winners import LATER
from schema.errors import RevolveError
from schema.experiment.document import Experiment
from schema.robot.trees import Integers


def robots(run: RunTables) -> pa.Table:
    """Return all robots that were evaluated, with sizes, rank and fitness, by birth."""
    fitness, islands, is_last, is_failed = _evaluated(run)
    table, greatest = run.population_table, fitness.copy()
    np.fmax.at(greatest, table.members, table.fitness)
    chosen = np.flatnonzero(~np.isnan(fitness))
    births = run.births.take(chosen)
    return pa.table(
        {
            "island": islands[chosen],
            "birth_island": births["island"],
            "birth": births["birth"],
            "is_last": is_last[chosen],
            "fitness": fitness[chosen],
            "rank": births["rank"],
            "ancestors": [run.lines[row].bit_count() for row in chosen.tolist()],
            **{name: values[chosen] for name, values in run.sizes.items()},
            "fitness_max": greatest[chosen],
            "births": births_so_far(run.births)[chosen],
            "is_failed": is_failed[chosen],
            **dict.fromkeys(LATER, pa.nulls(len(chosen), pa.float64())),
        }
    )


def births_so_far(births: pa.Table) -> npt.NDArray[np.int64]:
    """Return the number of births on each individual's island up to its own, (B,)."""
    islands = np.asarray(births["island"], np.int64)
    times = np.asarray(pc.fill_null(births["sim_time_s"], 0.0), np.float64)
    order = np.lexsort((np.asarray(births["birth"], np.int64), times, islands))
    _, first = np.unique(islands[order], return_index=True)
    so_far = np.empty(len(order), np.int64)
    counts = np.diff(first, append=len(order))
    so_far[order] = np.arange(1, len(order) + 1) - np.repeat(first, counts)
    return so_far


def _evaluated(run: RunTables) -> tuple[Numbers, Integers, Booleans, Booleans]:
    """Return each individual's fitness, if it lives at the end, and if it failed.

    Returns:
        The last fitness (or the mean that selection takes), the greatest one of an
        individual that was judged on several islands, NaN if there is none; the
        island of it, -1 if there is none; whether it is in a last population; whether
        all its evaluations failed.
    """
    fitness = np.full(run.births.num_rows, np.nan)
    islands = np.full(len(fitness), -1, np.int64)
    born_on = np.append(np.asarray(run.births["island"], np.int64), -1)

    def take(rows: Integers, values: Numbers, homes: Integers) -> None:
        """Replace the fitness of some births rows; of equal rows the fittest counts.

        Of equal fitness that on the island of birth counts.
        """
        is_native = homes == born_on[rows]
        greatness = np.nan_to_num(values, nan=-np.inf)
        order = np.lexsort((-homes, is_native, greatness, rows))
        order = order[rows[order] >= 0]
        last = order[is_last_of_each(rows[order])]
        least = np.nanmin(values, initial=0.0)
        fitness[rows[last]] = np.nan_to_num(values[last], nan=least)
        islands[rows[last]] = homes[last]

    def take_table(rows: pa.Table) -> None:
        values = np.asarray(rows["fitness"].to_numpy(), np.float64)
        homes = np.asarray(rows["island"], np.int64)
        take(rows_of(individual_ids(rows), run.births), values, homes)

    take_table(_evaluations(run))
    is_failed = ~np.isnan(fitness)
    evaluations = run.tables["evaluations"]
    succeeded = evaluations.filter(pc.is_valid(evaluations["fitness"]))
    rows = rows_of(individual_ids(succeeded), run.births)
    is_failed[rows[rows >= 0]] = False
    take_table(last_samples(run.tables["fitness"]))
    table = run.population_table
    chosen = table.is_last[table.group_of] & table.is_judged
    homes = table.islands[table.group_of[chosen]]
    take(table.members[chosen], table.fitness[chosen], homes)
    is_last = np.zeros(len(fitness), np.bool_)
    is_last[table.members[chosen]] = True
    return fitness, islands, is_last, is_failed


def _evaluations(run: RunTables) -> pa.Table:
    """Return the last evaluation of each individual on each island that it lives on.

    Natives of an island on which the mean of their evaluations counts have that mean,
    in which a failed evaluation counts as in selection.
    """
    every = run.tables["evaluations"]
    last = last_there(every, np.arange(every.num_rows))
    islands = np.asarray(last["island"], np.int64)
    averaged = [
        island
        for island in np.unique(islands).tolist()
        if run.islands
        and (again := island_settings(island, run.islands).selection.reevaluation)
        and again.fitness == "mean"
    ]
    if not averaged:
        return last
    values = np.asarray(every["fitness"].to_numpy(), np.float64)
    # The ids of the last evaluations are in this order, too.
    _, rows, counts = np.unique(
        residence_ids(every), return_inverse=True, return_counts=True
    )
    least = np.zeros(len(counts))
    np.fmin.at(least, rows, values)
    counted = np.where(np.isnan(values), least[rows], values)
    means = np.bincount(rows, counted) / counts
    succeeded = np.bincount(rows, ~np.isnan(values)) > 0
    is_native = islands == np.asarray(last["birth_island"], np.int64)
    is_averaged = is_native & np.isin(islands, averaged) & succeeded
    fitness = pc.if_else(pa.array(is_averaged), pa.array(means), last["fitness"])
    return last.set_column(last.schema.get_field_index("fitness"), "fitness", fitness)


def brains(run: RunTables) -> pa.Table:
    """Return measures of the brains of all robots, in the order of birth."""
    return pa.table(
        {
            "birth_island": run.births["island"],
            "birth": run.births["birth"],
            **{name: pa.array(each, from_pandas=True)
               for name, each in run.brains.items()},
        }
    )  # fmt: skip


class _Measure(NamedTuple):
    """A table of measures, as ``outputs.OUTPUTS`` describes it.

    Attributes:
        compute: returns the table without the columns that name the run.
        needs: tables of the run, as words.
        applies: whether a run with such an island has it; None: every run.
        islands: least number of islands of a run that has it.
    """

    compute: Callable[[RunTables], pa.Table]
    needs: str
    applies: Callable[[Experiment], object] | None = None
    islands: int = 0


_OF_ROBOTS = "births population evaluations fitness"
_OTHERS = {
    "robots": _Measure(robots, _OF_ROBOTS),
    "extremities": _Measure(lambda run: extremity_bins(robots(run)), _OF_ROBOTS),
    "families": _Measure(families, "births population"),
    "brains": _Measure(brains, "births"),
    "variability": _Measure(variability, "fitness", attrgetter("arena")),
    "interactions": _Measure(
        interactions, "births fitness deaths touches", records_touches
    ),
    "between": _Measure(mean_distances, "births population", islands=2),
    "named_measures": _Measure(
        named_measures, _OF_ROBOTS, attrgetter("measures.names")
    ),
    "cells": _Measure(cells, "births evaluations fitness", attrgetter("grid")),
    "fronts": _Measure(fronts, "births evaluations", objectives_of),
    "changes": _Measure(
        season_changes, "births population fitness", attrgetter("changes")
    ),
    "learning": _Measure(
        learning, "births population learning deaths", attrgetter("learning")
    ),
    "learning_curves": _Measure(
        learning_curves, "births learning", attrgetter("learning")
    ),
    "life_courses": _Measure(life_courses, "births fitness", has_rules),
    "lifespans": _Measure(lifespans, "births deaths", has_rules),
    "birth_places": _Measure(birth_places, "births", has_rules),
    "couples": _Measure(couples, "births matings", has_rules),
    "patch_means": _Measure(patch_means, "patches", has_rules),
    "migrants": _Measure(migrants, "births population migrations", islands=2),
}
"""Measures other than those of populations."""


def measure(
    run: RunTables, unread: frozenset[str] = frozenset()
) -> tuple[dict[str, pa.Table], Problems]:
    """Return all measures of a run.

    Args:
        run: the run's tables.
        unread: tables that could not be read; measures that need them are left out.

    Returns:
        Tables by name, with the columns of ``outputs.run_schema``; and the measures
        that were left out, with the reason.
    """
    measures = {}
    measures["populations"], problems = populations(run)
    for name, (compute, needs, applies, islands) in _OTHERS.items():
        if len(run.islands) < islands or (
            applies is not None and not any(map(applies, run.islands))
        ):
            continue
        missing = [table for table in needs.split() if table in unread]
        if missing:
            problems[name] = f"needs table {missing[0]}"
            continue
        try:
            measures[name] = compute(run)
        except RevolveError as error:
            problems[name] = str(error)
    return measures, problems
