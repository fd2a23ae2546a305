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
    """Return the row with the highest fitness; of equal ones that of the first birth.

    A copy of a migrant has a row on each island that it lives on; of equal ones that
    on the island of birth is returned.

    Returns:
        The row; None if no robot has a fitness.
    """
    judged = [row for row in rows if row["fitness"] is not None]
    if not judged:
        return None

    def place(row: Row) -> tuple[object, ...]:
        island, home = row["island"], row["birth_island"]
        home = island if home is None else home
        return -row["fitness"], home, row["birth"], island != home, island

    return min(judged, key=place)
