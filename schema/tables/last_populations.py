"""The last recorded population of each island of a run, and its best robot."""

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.compute as pc

from schema.tables.files import read_table

Row = Mapping[str, Any]


def last_populations(folder: Path) -> list[Row]:
    """Return the rows of the table ``population`` of each island's last population.

    Raises:
        RunFolderError: the table is damaged.
    """
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


def best_of(rows: Iterable[Row]) -> Row | None:
    """Return the first row by ``fittest_first``; None if no robot has a fitness."""
    judged = (row for row in rows if row["fitness"] is not None)
    return min(judged, key=fittest_first, default=None)


def fittest_first(row: Row) -> tuple[float, ...]:
    """Return the key by which rows with a fitness are sorted, the best robot first.

    Of equally fit robots that of the first birth precedes. A copy of a migrant has a
    row on each island that it lives on; that on the island of birth precedes.
    """
    island, home = row["island"], row["birth_island"]
    home = island if home is None else home
    return -row["fitness"], home, row["birth"], island != home, island
