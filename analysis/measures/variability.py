"""Variability: changes of a robot's fitness during its life in an arena."""

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc

from analysis.measures.population_table import last_there


def variability(fitness: pa.Table) -> pa.Table:
    """Return the range of each robot's fitness, relative to that of the population.

    Only samples of mature robots are used. A robot with less than two of them has no
    row.

    Args:
        fitness: samples of one run's arenas: ``island``, ``birth_island`` and
            ``birth``, ``sim_time_s`` [s], ``fitness`` [m/s], ``is_mature``.

    Returns:
        One row per ``island`` and robot there (``birth_island``, ``birth``):
        ``samples``, ``fitness_range`` [m/s], ``population_range`` (greatest minus
        least fitness on the island from the robot's first sample there to its last)
        [m/s], ``variability`` (``fitness_range`` divided by ``population_range``; null
        if that is 0).

    Source: Hupkes 2016, figure 6.8; defined by its caption, as the code of the figure
    is not published.
    """
    mature = fitness.filter(fitness["is_mature"]).sort_by("sim_time_s")
    keys, ends = ["island", "birth_island", "birth"], ("min", "max")
    totals = [(name, end) for name in ("sim_time_s", "fitness") for end in ends]
    stays = mature.group_by(keys, use_threads=False).aggregate(
        [*totals, ("fitness", "count")]
    )
    stays = stays.filter(pc.field("fitness_count") > 1)
    stays = stays.sort_by([(key, "ascending") for key in keys])
    islands = np.asarray(mature["island"], np.int64)
    times, values = (
        np.asarray(mature[name], np.float64) for name in ("sim_time_s", "fitness")
    )
    own = np.asarray(stays["fitness_max"]) - np.asarray(stays["fitness_min"])
    population = np.zeros(len(own))
    homes = np.asarray(stays["island"], np.int64)
    for island in np.unique(homes).tolist():
        here = islands == island
        times_here, fitness_here = times[here], values[here]
        mine = np.flatnonzero(homes == island)
        chosen = stays.take(pa.array(mine))
        begin = np.searchsorted(times_here, chosen["sim_time_s_min"], side="left")
        until = np.searchsorted(times_here, chosen["sim_time_s_max"], side="right")
        spans = zip(mine.tolist(), begin.tolist(), until.tolist(), strict=True)
        for robot, first, end in spans:
            population[robot] = np.ptp(fitness_here[first:end])
    ratio = np.full(len(own), np.nan)
    np.divide(own, population, out=ratio, where=population > 0)
    return pa.table(
        {
            **{key: stays[key] for key in keys},
            "samples": stays["fitness_count"],
            "fitness_range": own,
            "population_range": population,
            "variability": pa.array(ratio, from_pandas=True),
        }
    )


def last_samples(fitness: pa.Table) -> pa.Table:
    """Return the last sample of each mature robot in each of its arenas.

    Args:
        fitness: samples, as for ``variability``.
    """
    mature = fitness.filter(fitness["is_mature"])
    return last_there(mature, np.asarray(mature["sim_time_s"], np.float64))
