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
    rows = []
    homes, at, by = (
        np.asarray(residence_columns(each)["island"])
        for each in (robots, both, pairs[:, 0])
    )
    for island in np.unique(homes).tolist():
        here = homes == island
        count, seconds = int(here.sum()), float(lived[here].sum())
        touched = int(np.isin(robots[here], both).sum())
        contact_s = float(time[at == island].sum())
        row = {
            "island": island,
            "robots": count,
            "lived_s": seconds,
            "pairs": int((by == island).sum()),
            "touched": touched / count,
            "touching": contact_s / seconds if seconds else None,
        }
        rows.append(row)
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
    events = [
        (residence_ids(table), np.asarray(table["sim_time_s"], np.float64))
        for table in (natives, fitness, deaths)
    ]
    starts: dict[int, float] = {}
    for ids, times in events[:2]:
        found, firsts = np.unique(ids, return_index=True)
        for robot, time in zip(found.tolist(), times[firsts].tolist(), strict=True):
            starts.setdefault(robot, time)
    ends = dict(zip(*(column.tolist() for column in events[2]), strict=True))
    last: dict[int, float] = {}
    for ids, times in events:
        islands = np.asarray(residence_columns(ids)["island"])
        for island in np.unique(islands).tolist():
            latest = float(times[islands == island].max())
            last[island] = max(latest, last.get(island, 0.0))
    robots = np.array(sorted(starts), np.int64)
    homes = residence_columns(robots)["island"].to_pylist()
    lived = [
        ends.get(robot, last[island]) - starts[robot]
        for robot, island in zip(robots.tolist(), homes, strict=True)
    ]
    return robots, np.array(lived, np.float64)
