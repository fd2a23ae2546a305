"""What is measured of a population, at every number of births recorded."""

from collections.abc import Callable

import numpy as np
import pyarrow as pa

from analysis.measures.ancestry import foreign_share, unique_ancestors
from analysis.measures.diversity import diversity
from analysis.measures.outputs import POPULATION
from analysis.measures.population_table import Numbers
from analysis.measures.retention import retention
from analysis.measures.run_tables import Refusals, RunTables
from schema.errors import RevolveError

Columns = dict[str, Numbers]


def _fitness(run: RunTables) -> Columns:
    """Return how many there are, and how fit (Hupkes 2016, figures 6.2 and 6.3)."""
    who = run.population_table
    best = np.full(len(who), -np.inf)
    np.fmax.at(best, who.group_of, who.fitness)
    return {
        "size": who.sizes.astype(np.float64),
        "judged": who.sum(who.is_judged.astype(np.float64)),
        "fitness": who.mean(who.fitness),
        "fitness_best": np.where(np.isfinite(best), best, np.nan),
    }


def _rank(run: RunTables) -> Columns:
    """Return the mean rank of the judged (Hupkes 2016, eq. 6.1, figure 6.6)."""
    return {"rank": _mean(run, np.asarray(run.births["rank"], np.float64))}


def _ancestors(run: RunTables) -> Columns:
    """Return unique ancestors, absolute and by robot (figure 6.4)."""
    count = unique_ancestors(run.population_table, run.lines).astype(np.float64)
    judged = run.population_table.sum(run.population_table.is_judged.astype(np.float64))
    unknown = np.full(len(count), np.nan)
    share = np.divide(count, judged, out=unknown, where=judged > 0)
    return {"ancestors": count, "ancestors_per_robot": share}


def _diversity(run: RunTables) -> Columns:
    return {"diversity": diversity(run.population_table, run.trees)}


def _retention(run: RunTables) -> Columns:
    return {"retention": retention(run.population_table)}


def _foreign(run: RunTables) -> Columns:
    return {"foreign": foreign_share(run.population_table, run.births, run.parents)}


def _sizes(run: RunTables) -> Columns:
    """Return mean sizes of the judged (figures 6.9 to 6.16)."""
    found = {name: _mean(run, values) for name, values in run.sizes.items()}
    no_touch = (run.sizes["touch_sensors"] == 0).astype(np.float64)
    return {**found, "without_touch": _mean(run, no_touch)}


def _mean(run: RunTables, values: Numbers) -> Numbers:
    """Return the mean of the judged of each population, of values per birth."""
    who = run.population_table
    return who.mean(np.where(who.is_judged, values[who.members], np.nan))


_POPULATION: tuple[Callable[[RunTables], Columns], ...] = (
    _fitness, _rank, _ancestors, _diversity, _retention, _foreign, _sizes
)  # fmt: skip


def populations(run: RunTables) -> tuple[pa.Table, Refusals]:
    """Return what is measured of each recorded population, and what could not be.

    Returns:
        One row per ``island`` and ``births``, ascending, with the columns of
        ``outputs.POPULATION``; a measure that could not be had is null.
    """
    found: Columns = {}
    refusals: Refusals = {}
    for measure in _POPULATION:
        try:
            found |= measure(run)
        except RevolveError as error:
            refusals[measure.__name__.strip("_")] = str(error)
    nothing = np.full(len(run.population_table), np.nan)
    columns = {name: found.get(name, nothing) for name in POPULATION}
    table = pa.table(
        {
            "island": run.population_table.islands,
            "births": run.population_table.births,
            **{
                name: pa.array(values, from_pandas=True)
                for name, values in columns.items()
            },
        }
    )
    return table, refusals
