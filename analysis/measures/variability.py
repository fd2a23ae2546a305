"""Variability: changes of a robot's fitness during its life in an arena."""

import numpy as np
import pyarrow as pa

from analysis.measures.population_table import (
    Numbers,
    last_there,
    residence_columns,
    residence_ids,
)


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
    mature = fitness.filter(fitness["is_mature"])
    times = np.asarray(mature["sim_time_s"], np.float64)
    values = np.asarray(mature["fitness"], np.float64)
    robots = residence_ids(mature)
    order = np.lexsort((times, robots))
    found, firsts, samples = np.unique(
        robots[order], return_index=True, return_counts=True
    )
    islands = np.asarray(mature["island"], np.int64)
    moments = {
        island: _moments(times[islands == island], values[islands == island])
        for island in np.unique(islands).tolist()
    }
    own, population = np.zeros(len(found)), np.zeros(len(found))
    for robot, (first, count) in enumerate(zip(firsts, samples, strict=True)):
        mine = order[first : first + count]
        own[robot] = np.ptp(values[mine])
        clock, least, greatest = moments[int(islands[mine[0]])]
        begin = np.searchsorted(clock, times[mine[0]], side="left")
        until = np.searchsorted(clock, times[mine[-1]], side="right")
        population[robot] = greatest[begin:until].max() - least[begin:until].min()
    unknown = np.full(len(own), np.nan)
    ratio = np.divide(own, population, out=unknown, where=population > 0)
    table = pa.table(
        {
            **residence_columns(found),
            "samples": samples,
            "fitness_range": own,
            "population_range": population,
            "variability": pa.array(ratio, from_pandas=True),
        }
    )
    return table.filter(pa.array(samples > 1))


def _moments(times: Numbers, values: Numbers) -> tuple[Numbers, Numbers, Numbers]:
    """Return the sample times, and the least and greatest fitness at each of them."""
    order = np.argsort(times)
    clock, starts = np.unique(times[order], return_index=True)
    least, greatest = (
        extreme.reduceat(values[order], starts) for extreme in (np.minimum, np.maximum)
    )
    return clock, least, greatest


def last_samples(fitness: pa.Table) -> pa.Table:
    """Return the last sample of each mature robot in each of its arenas.

    Args:
        fitness: samples, as for ``variability``.
    """
    mature = fitness.filter(fitness["is_mature"])
    return last_there(mature, np.asarray(mature["sim_time_s"], np.float64))
