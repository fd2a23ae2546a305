"""How much robots of an arena touch each other."""

import numpy as np
import pyarrow as pa

from analysis.measures.population_table import Numbers, stays, unnamed
from analysis.measures.trees import Integers


def interactions(
    births: pa.Table, fitness: pa.Table, deaths: pa.Table, touches: pa.Table
) -> pa.Table:
    """Return how many robots touched another, and for how much of their lives.

    Args:
        births: of one run: ``island``, ``birth``, ``sim_time_s`` [s] (null off-line).
        fitness: samples: ``island``, ``birth_island``, ``birth``, ``sim_time_s`` [s].
        deaths: the same columns.
        touches: the same, ``other_island`` and ``other_birth`` (the other's name), and
            ``duration_s`` [s]; one row per pair and advance.

    Returns:
        One row per ``island`` with robots on-line: ``robots`` that lived there,
        ``lived_s`` (all of them together, to the last that the tables tell; an
        immigrant from its first sample) [s], ``pairs`` that ever touched, ``touched``
        (share of robots) and ``touching`` (time of touch, counted for both robots of
        a pair, by time lived: who touches two at a time counts twice).

    Source: own; Hupkes 2016, chapter 7, asks for it.
    """
    robots, lived = _lives(births, fitness, deaths)
    first, second = stays(touches), stays(_others(touches))
    pairs = np.unique(np.stack([first, second], axis=1), axis=0)
    both = np.concatenate([first, second])
    time = np.tile(np.asarray(touches["duration_s"], np.float64), 2)
    rows = []
    homes, at, by = (
        np.asarray(unnamed(each)["island"]) for each in (robots, both, pairs[:, 0])
    )
    for island in np.unique(homes).tolist():
        here = homes == island
        count, seconds = int(here.sum()), float(lived[here].sum())
        touched = int(np.isin(robots[here], both).sum())
        row = {
            "island": island,
            "robots": count,
            "lived_s": seconds,
            "pairs": int((by == island).sum()),
            "touched": touched / count,
            "touching": float(time[at == island].sum()) / seconds if seconds else None,
        }
        rows.append(row)
    kinds = [pa.int32(), pa.int64(), pa.float64(), pa.int64(), pa.float64()]
    columns = ["island", "robots", "lived_s", "pairs", "touched", "touching"]
    fields = list(zip(columns, [*kinds, pa.float64()], strict=True))
    return pa.Table.from_pylist(rows, pa.schema(fields))


def _others(touches: pa.Table) -> pa.Table:
    """Return where the second of each pair is, and its name."""
    columns = ["island", "other_island", "other_birth"]
    return touches.select(columns).rename_columns(["island", "birth_island", "birth"])


def _lives(
    births: pa.Table, fitness: pa.Table, deaths: pa.Table
) -> tuple[Integers, Numbers]:
    """Return who lived where, (S,), and for how long, (S,) [s]."""
    born = births.filter(births["sim_time_s"].is_valid())
    natives = born.append_column("birth_island", born["island"])
    told = [
        (stays(table), np.asarray(table["sim_time_s"], np.float64))
        for table in (natives, fitness, deaths)
    ]
    starts: dict[int, float] = {}
    for who, times in told[:2]:
        found, firsts = np.unique(who, return_index=True)
        for robot, time in zip(found.tolist(), times[firsts].tolist(), strict=True):
            starts.setdefault(robot, time)
    ends = dict(zip(told[2][0].tolist(), told[2][1].tolist(), strict=True))
    last: dict[int, float] = {}
    for who, times in told:
        islands = np.asarray(unnamed(who)["island"])
        for island in np.unique(islands).tolist():
            latest = float(times[islands == island].max())
            last[island] = max(latest, last.get(island, 0.0))
    robots = np.array(sorted(starts), np.int64)
    homes = unnamed(robots)["island"].to_pylist()
    lived = [
        ends.get(robot, last[island]) - starts[robot]
        for robot, island in zip(robots.tolist(), homes, strict=True)
    ]
    return robots, np.array(lived, np.float64)
