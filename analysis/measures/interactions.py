"""Contacts between the robots of an arena."""

import numpy as np
import pyarrow as pa

from analysis.measures.outputs import run_schema
from analysis.measures.population_table import Numbers, residence_columns, residence_ids
from analysis.measures.trees import Integers


def interactions(
    births: pa.Table, fitness: pa.Table, deaths: pa.Table, touches: pa.Table
) -> pa.Table:
    """Return how many robots touched another robot, and for how long.

    Args:
        births: births of one run: ``island``, ``birth``, ``sim_time_s`` [s] (null
            off-line).
        fitness: samples: ``island``, ``birth_island``, ``birth``, ``sim_time_s`` [s].
        deaths: deaths, with the same columns.
        touches: contacts, one row per pair and advance: the same columns,
            ``other_island`` and ``other_birth`` (id of the other robot), and
            ``duration_s`` [s].

    Returns:
        One row per ``island`` with on-line robots: ``robots`` that lived there,
        ``lived_s`` (sum of their lifetimes up to the last recorded time; an
        immigrant's starts with its first sample) [s], ``pairs`` that ever touched,
        ``touched`` (share of robots) and ``touching`` (contact time divided by
        lifetime; each contact counts for both robots, and simultaneous contacts of a
        robot count separately).

    Source: own; proposed in Hupkes 2016, chapter 7.
    """
    robots, lived = _lives(births, fitness, deaths)
    first, second = residence_ids(touches), residence_ids(_others(touches))
    pairs = np.unique(np.stack([first, second], axis=1), axis=0)
    both = np.concatenate([first, second])
    time = np.tile(np.asarray(touches["duration_s"], np.float64), 2)
    ids = (robots, both, pairs[:, 0])
    homes, at, by = (np.asarray(residence_columns(each)["island"]) for each in ids)
    rows = []
    for island in np.unique(homes).tolist():
        here = homes == island
        count, seconds = int(here.sum()), float(lived[here].sum())
        touched = int(np.isin(robots[here], both).sum())
        contact_s = float(time[at == island].sum())
        rows.append(
            {
                "island": island,
                "robots": count,
                "lived_s": seconds,
                "pairs": int((by == island).sum()),
                "touched": touched / count,
                "touching": contact_s / seconds if seconds else None,
            }
        )
    return pa.Table.from_pylist(rows, run_schema("interactions"))


def _others(touches: pa.Table) -> pa.Table:
    """Return the residences of the second robots of the pairs."""
    columns = ["island", "other_island", "other_birth"]
    return touches.select(columns).rename_columns(["island", "birth_island", "birth"])


def _lives(
    births: pa.Table, fitness: pa.Table, deaths: pa.Table
) -> tuple[Integers, Numbers]:
    """Return the residences of all robots, (S,), and their lengths, (S,) [s]."""
    born = births.filter(births["sim_time_s"].is_valid())
    natives = born.append_column("birth_island", born["island"])
    events = (natives, fitness, deaths)
    ids = np.concatenate([residence_ids(each) for each in events])
    times = np.concatenate([np.asarray(each["sim_time_s"]) for each in events])
    islands = np.asarray(residence_columns(ids)["island"])
    # A native's first event is its birth, an immigrant's its first sample.
    alive = natives.num_rows + fitness.num_rows
    robots, firsts = np.unique(ids[:alive], return_index=True)
    ends = dict(zip(ids[alive:].tolist(), times[alive:].tolist(), strict=True))
    last = {home: times[islands == home].max() for home in np.unique(islands).tolist()}
    stays = zip(robots.tolist(), islands[firsts].tolist(), strict=True)
    until = [ends.get(robot, last[home]) for robot, home in stays]
    return robots, np.array(until, np.float64) - times[firsts]
