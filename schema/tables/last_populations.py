"""The best robots of a run: those of the last populations, of archives, and ever.

*Best* is the fittest robot of the last recorded population of all islands, and *best
ever* the fittest that was ever evaluated, dead or alive. Of both, ``fittest_first``
says which of equally fit robots is meant. A damaged table raises ``RunFolderError``.
"""

from collections.abc import Iterable, Iterator, Mapping
from itertools import groupby
from operator import itemgetter
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.compute as pc

from schema.robot.ids import BirthId
from schema.tables.files import born_as, read_table

Row = Mapping[str, Any]
_AT_ONCE = 100
"""Number of rows that become Python objects together."""


def last_populations(folder: Path) -> list[Row]:
    """Return the rows of the table ``population`` of each island's last population."""
    rows = read_table(folder, "population")
    newest = rows.group_by("island").aggregate([("births", "max")]).to_pylist()
    last = [
        rows.filter(
            (pc.field("island") == each["island"])
            & (pc.field("births") == each["births_max"])
        )
        for each in sorted(newest, key=lambda each: each["island"])
    ]
    return pa.concat_tables(last).to_pylist() if last else []


def best_ever(folder: Path, only: BirthId | None = None) -> Iterator[Row]:
    """Yield rows of all robots with a fitness, the best ever first.

    Robots of arenas count with their samples while they were mature. Arrow sorts the
    rows by fitness; only those that are taken, and equal ones, become Python objects.
    ``only`` takes the row of one individual on its island of birth.

    Yields:
        Island, individual and greatest fitness of each robot on each island.
    """
    keys = ["island", "birth_island", "birth"]
    columns = [*keys, "fitness"]
    wanted, home = pc.scalar(True), pc.field("birth_island")
    if only is not None:
        wanted = born_as(only) & (home.is_null() | (home == only.island))
    is_judged = pc.field("fitness").is_valid() & wanted
    alone = read_table(folder, "evaluations", columns, is_judged)
    columns.append("is_mature")
    samples = read_table(folder, "fitness", columns, pc.field("is_mature") & wanted)
    # The fitness of a sample is never null.
    every = pa.concat_tables([alone, samples], promote_options="default")
    greatest = every.group_by(keys).aggregate([("fitness", "max")])
    falling = greatest.sort_by([("fitness_max", "descending")])
    rows = (
        {**row, "fitness": row["fitness_max"]}
        for batch in falling.to_batches(max_chunksize=_AT_ONCE)
        for row in batch.to_pylist()
    )
    for _, equal in groupby(rows, itemgetter("fitness")):
        yield from sorted(equal, key=fittest_first)


def best_of(rows: Iterable[Row]) -> Row | None:
    """Return the first row by ``fittest_first``; None if no robot has a fitness."""
    return next(iter(fittest(rows)), None)


def fittest(rows: Iterable[Row]) -> list[Row]:
    """Return the rows with a fitness by ``fittest_first``."""
    judged = (row for row in rows if row["fitness"] is not None)
    return sorted(judged, key=fittest_first)


def fittest_first(row: Row) -> tuple[float, ...]:
    """Return the key by which rows with a fitness are sorted, the best robot first.

    Of equally fit robots that of the first birth precedes. A copy of a migrant has a
    row on each island that it lives on; that on the island of birth precedes.
    """
    island, home = row["island"], row["birth_island"]
    home = island if home is None else home
    return -row["fitness"], home, row["birth"], island != home, island


def archive_at(folder: Path, births: int | None = None) -> list[dict[str, Any]]:
    """Return the rows of the table ``archive`` that held at so many births, or last.

    They are by island and entry; ``replaced_at`` are the births at which an entry
    changed next, None if it stayed.
    """
    held: dict[tuple[int, str], dict[str, Any]] = {}
    for row in read_table(folder, "archive").to_pylist():
        entry = row["island"], row["entry"]
        if births is None or row["births"] <= births:
            held[entry] = {**row, "replaced_at": None}
        elif entry in held and held[entry]["replaced_at"] is None:
            held[entry]["replaced_at"] = row["births"]
    return [row for _, row in sorted(held.items()) if row["birth"] is not None]
