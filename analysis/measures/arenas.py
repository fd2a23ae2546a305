"""Arenas: contacts between robots, and changes of fitness during their lives."""

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc

from analysis.measures.outputs import run_schema
from analysis.measures.population_table import (
    Numbers,
    last_there,
    ratio,
    residence_ids,
    residence_islands,
)
from analysis.measures.run_tables import RunTables
from schema.robot.trees import Integers


def interactions(run: RunTables) -> pa.Table:
    """Return how many robots of each arena touched another robot, and for how long.

    Robots live up to the last recorded time; an immigrant's life starts with its first
    sample.

    Source: own; proposed in Hupkes 2016, chapter 7.
    """
    robots, lived = _lives(run)
    touches = run.tables["touches"]
    names = ["island", "birth_island", "birth"]
    others = touches.select(["island", "other_island", "other_birth"])
    first, second = map(residence_ids, (touches, others.rename_columns(names)))
    pairs = np.unique(np.stack([first, second], axis=1), axis=0)
    both = np.concatenate([first, second])
    time = np.tile(np.asarray(touches["duration_s"], np.float64), 2)
    ids = (robots, both, pairs[:, 0])
    homes, at, by = map(residence_islands, ids)
    rows = []
    for island in np.unique(homes).tolist():
        here = homes == island
        count, lived_s = int(here.sum()), float(lived[here].sum())
        contact_s = float(time[at == island].sum())
        rows.append(
            {
                "island": island,
                "robots": count,
                "lived_s": lived_s,
                "pairs": int((by == island).sum()),
                "touched": int(np.isin(robots[here], both).sum()) / count,
                "touching": contact_s / lived_s if lived_s else None,
            }
        )
    return pa.Table.from_pylist(rows, run_schema("interactions"))


def _lives(run: RunTables) -> tuple[Integers, Numbers]:
    """Return the residences of all robots, (S,), and their lengths, (S,) [s]."""
    born = run.births.filter(run.births["sim_time_s"].is_valid())
    natives = born.append_column("birth_island", born["island"])
    events = (natives, run.tables["fitness"], run.tables["deaths"])
    ids = np.concatenate([residence_ids(each) for each in events])
    times = np.concatenate([np.asarray(each["sim_time_s"]) for each in events])
    islands = residence_islands(ids)
    # A native's first event is its birth, an immigrant's its first sample.
    alive = natives.num_rows + run.tables["fitness"].num_rows
    robots, firsts = np.unique(ids[:alive], return_index=True)
    ends = dict(zip(ids[alive:].tolist(), times[alive:].tolist(), strict=True))
    last = {home: times[islands == home].max() for home in np.unique(islands).tolist()}
    stays = zip(robots.tolist(), islands[firsts].tolist(), strict=True)
    until = [ends.get(robot, last[home]) for robot, home in stays]
    return robots, np.array(until, np.float64) - times[firsts]


def variability(run: RunTables) -> pa.Table:
    """Return the range of each robot's fitness, relative to that of the population.

    Only samples of mature robots are used, of robots with two at least. The range of
    the population is that of all samples on the island during the robot's samples.

    Source: Hupkes 2016, figure 6.8; defined by its caption, as the code of the figure
    is not published.
    """
    samples = run.tables["fitness"]
    mature = samples.filter(samples["is_mature"]).sort_by("sim_time_s")
    keys, ends = ["island", "birth_island", "birth"], ("min", "max")
    totals = [(name, end) for name in ("sim_time_s", "fitness") for end in ends]
    stays = mature.group_by(keys, use_threads=False).aggregate(
        [*totals, ("fitness", "count")]
    )
    stays = stays.filter(pc.field("fitness_count") > 1)
    stays = stays.sort_by([(key, "ascending") for key in keys])
    islands, homes = (np.asarray(each["island"], np.int64) for each in (mature, stays))
    times, values = (
        np.asarray(mature[name], np.float64) for name in ("sim_time_s", "fitness")
    )
    own = np.asarray(stays["fitness_max"]) - np.asarray(stays["fitness_min"])
    population = np.zeros(len(own))
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
    return pa.table(
        {
            **{key: stays[key] for key in keys},
            "samples": stays["fitness_count"],
            "fitness_range": own,
            "population_range": population,
            "variability": pa.array(ratio(own, population), from_pandas=True),
        }
    )


def last_samples(fitness: pa.Table) -> pa.Table:
    """Return the last sample of each mature robot in each of its arenas."""
    mature = fitness.filter(fitness["is_mature"])
    return last_there(mature, np.asarray(mature["sim_time_s"], np.float64))
