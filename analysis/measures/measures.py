"""What one run's tables say: all measures, and the tables they make.

Everything is a function of the run's own tables. What a damaged table keeps from
being measured is left out and named; all else is measured.
"""

from collections.abc import Callable

import pyarrow as pa

from analysis.measures.bodies import extremity_bins
from analysis.measures.diversity import mean_distances
from analysis.measures.interactions import interactions
from analysis.measures.migrants import migrants
from analysis.measures.populations import populations
from analysis.measures.robots import robots
from analysis.measures.run_tables import Refusals, RunTables
from analysis.measures.variability import variability
from schema.errors import RevolveError

_OTHERS: dict[str, tuple[Callable[[RunTables], pa.Table], tuple[str, ...]]] = {
    "robots": (robots, ("births", "population", "evaluations", "fitness")),
    "extremities": (
        lambda run: extremity_bins(robots(run)),
        ("births", "population", "evaluations", "fitness"),
    ),
    "variability": (lambda run: variability(run.tables["fitness"]), ("fitness",)),
    "interactions": (
        lambda run: interactions(
            run.births, *(run.tables[name] for name in ("fitness", "deaths", "touches"))
        ),
        ("births", "fitness", "deaths", "touches"),
    ),
    "between": (
        lambda run: mean_distances(run.population_table, run.trees),
        ("births", "population"),
    ),
    "migrants": (
        lambda run: migrants(
            run.tables["migrations"], run.births, run.population_table, run.lines
        ),
        ("births", "population", "migrations"),
    ),
}
"""Measures and the tables that they need, beside those of populations."""


def measure(
    run: RunTables, wanted: frozenset[str], unread: frozenset[str] = frozenset()
) -> tuple[dict[str, pa.Table], Refusals]:
    """Return all measures of a run.

    Args:
        run: its tables.
        wanted: which of variability, interactions, between and migrants have sense.
        unread: tables that could not be read: nothing is made of half a run's rows.

    Returns:
        Tables by name, each with the columns of ``outputs.schema`` less the
        run's name; and the measures that could not be had, with the reason.
    """
    found = {}
    found["populations"], refusals = populations(run)
    for name, (function, needed) in _OTHERS.items():
        if name not in {"robots", "extremities"} | wanted:
            continue
        missing = [table for table in needed if table in unread]
        if missing:
            refusals[name] = f"needs table {missing[0]}"
            continue
        try:
            found[name] = function(run)
        except RevolveError as error:
            refusals[name] = str(error)
    return found, refusals
