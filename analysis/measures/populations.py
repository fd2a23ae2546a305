"""Measures of each recorded population; the last populations of measured runs."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc

from analysis.measures.ancestry import (
    foreign_share,
    phylogenetic_diversity,
    unique_ancestors,
)
from analysis.measures.diversity.distances import diversity
from analysis.measures.diversity.grids import grid_measures
from analysis.measures.outputs import POPULATION
from analysis.measures.population_table import Numbers, PopulationTable, ratio
from analysis.measures.run_tables import Problems, RunTables
from schema.errors import RevolveError

Columns = dict[str, Numbers]

RETENTION_BIRTHS = 120
"""Births after which retention is measured: 8 generations of 15, as in the thesis."""


def retention(table: PopulationTable, step: int = RETENTION_BIRTHS) -> Numbers:
    """Return the share of each population that is alive ``step`` births later, (G,).

    All members count, mature or not. NaN if no population of the island is recorded
    at exactly that number of births.

    Source: Hupkes 2016, table 6.2 and figure 6.7.
    """
    # Island, births and individual as one number each, smaller than 2^63.
    width = int(table.members.max(initial=0)) + 1
    height = int(table.births.max(initial=0)) + step + 1
    group = table.group_of
    base = table.islands * height + table.births
    now = base[group] * width + table.members
    later = (base[group] + step) * width + table.members
    remains = table.mean(np.isin(later, now).astype(np.float64))
    return np.where(np.isin(base + step, base), remains, np.nan)


def _fitness(run: RunTables) -> Columns:
    """Return sizes and fitness (Hupkes 2016, figures 6.2 and 6.3)."""
    table = run.population_table
    best = np.full(len(table), -np.inf)
    np.fmax.at(best, table.group_of, table.fitness)
    return {
        "size": table.sizes.astype(np.float64),
        "judged": table.sum(table.is_judged),
        "fitness": table.mean(table.fitness),
        "fitness_best": np.where(np.isfinite(best), best, np.nan),
    }


def _ancestors(run: RunTables) -> Columns:
    """Return unique ancestors, in total and per robot (figure 6.4)."""
    table = run.population_table
    count = unique_ancestors(table, run.lines).astype(np.float64)
    share = ratio(count, table.sum(table.is_judged))
    return {"ancestors": count, "ancestors_per_robot": share}


def _means(run: RunTables, of_births: Columns) -> Columns:
    """Return each population's means of one value per birth; unevaluated are ignored.

    Rank (Hupkes 2016, eq. 6.1, figure 6.6), sizes (6.9 to 6.16), and brains.
    """
    table = run.population_table
    return {
        name: table.mean(np.where(table.is_judged, values[table.members], np.nan))
        for name, values in of_births.items()
    }


def _of_births(run: RunTables) -> Columns:
    touch = run.sizes["touch_sensors"]
    shares = {"without_touch": touch == 0, "one_touch": touch == 1,
              "two_touch": touch > 1}  # fmt: skip
    return {
        "rank": np.asarray(run.births["rank"], np.float64),
        **run.sizes,
        **{name: is_so.astype(np.float64) for name, is_so in shares.items()},
    }


_POPULATION: dict[str, Callable[[RunTables], Columns]] = {
    "fitness": _fitness,
    "ancestors": _ancestors,
    "diversity": lambda run: {"diversity": diversity(run.population_table, run.trees)},
    "phylogeny": lambda run: {
        "phylogenetic_diversity": phylogenetic_diversity(
            run.population_table, run.parents
        )
    },
    "grid": grid_measures,
    "retention": lambda run: {"retention": retention(run.population_table)},
    "foreign": lambda run: {
        "foreign": foreign_share(run.population_table, run.births, run.parents)
    },
    "means": lambda run: _means(run, _of_births(run)),
    "brains": lambda run: _means(
        run, {name: run.brains[name] for name in ("recurrent", "sensed")}
    ),
}
"""Measures of populations, by the name under which they are reported if left out."""


def populations(run: RunTables) -> tuple[pa.Table, Problems]:
    """Return the measures of each recorded population, and why some were left out.

    Rows are by ``island`` and ``births``, ascending; measures left out are null.
    """
    measures: Columns = {}
    problems: Problems = {}
    for name, measure in _POPULATION.items():
        try:
            measures |= measure(run)
        except RevolveError as error:
            problems[name] = str(error)
    table = run.population_table
    unknown = np.full(len(table), np.nan)
    columns = {"island": table.islands, "births": table.births} | {
        name: pa.array(measures.get(name, unknown), from_pandas=True)
        for name in POPULATION
    }
    return pa.table(columns), problems


def last_rows(populations: pa.Table) -> list[dict[str, Any]]:
    """Return the rows of each island's last population, by experiment and folder."""
    keys = ["experiment", "folder", "island"]
    last = populations.group_by(keys, use_threads=False).aggregate([("births", "max")])
    joined = populations.join(last, keys)
    rows = joined.filter(pc.equal(joined["births"], joined["births_max"]))
    ordered = rows.sort_by([(key, "ascending") for key in keys])
    last_populations: list[dict[str, Any]] = ordered.to_pylist()
    return last_populations
