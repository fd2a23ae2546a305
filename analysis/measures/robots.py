"""Everybody who was ever judged in a run."""

import numpy as np
import pyarrow as pa

from analysis.measures.population_table import Numbers, Truths, names, rows_of
from analysis.measures.run_tables import RunTables
from analysis.measures.variability import last_fitness


def robots(run: RunTables) -> pa.Table:
    """Return everybody who was ever judged, with sizes, rank and fitness.

    Returns:
        One row per individual, in the order of birth, with the columns of
        ``outputs.OUTPUTS["robots"]`` but the run's.
    """
    fitness, is_last = _judged(run)
    chosen = np.flatnonzero(~np.isnan(fitness))
    births = run.births.take(chosen)
    return pa.table(
        {
            "birth_island": births["island"],
            "birth": births["birth"],
            "is_last": is_last[chosen],
            "fitness": fitness[chosen],
            "rank": births["rank"],
            "ancestors": [run.lines[row].bit_count() for row in chosen.tolist()],
            **{name: values[chosen] for name, values in run.sizes.items()},
        }
    )


def _judged(
    run: RunTables,
) -> tuple[Numbers, Truths]:
    """Return each individual's last fitness, NaN if none, and who is alive last."""
    fitness = np.full(run.births.num_rows, np.nan)
    evaluations = run.tables["evaluations"]
    rows = rows_of(names(evaluations), run.births)
    outcome = np.asarray(evaluations["fitness"].to_numpy(), np.float64)
    fitness[rows[rows >= 0]] = np.nan_to_num(outcome[rows >= 0], nan=0.0)
    named, sampled = last_fitness(run.tables["fitness"])
    rows = rows_of(named, run.births)
    fitness[rows[rows >= 0]] = sampled[rows >= 0]
    who = run.population_table
    chosen = who.is_last[who.group_of] & who.is_judged
    fitness[who.members[chosen]] = who.fitness[chosen]
    is_last = np.zeros(len(fitness), np.bool_)
    is_last[who.members[chosen]] = True
    return fitness, is_last
