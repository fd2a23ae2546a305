"""Content of the archives of a run at any number of births."""

from pathlib import Path
from typing import Any

from schema.tables.files import read_table


def archive_at(folder: Path, births: int | None = None) -> list[dict[str, Any]]:
    """Return the rows of the table ``archive`` that held at so many births, or last.

    They are by island and entry; ``replaced_at`` are the births at which an entry
    changed next, None if it stayed.

    Raises:
        RunFolderError: the table is damaged.
    """
    held: dict[tuple[int, str], dict[str, Any]] = {}
    for row in read_table(folder, "archive").to_pylist():
        entry = row["island"], row["entry"]
        if births is None or row["births"] <= births:
            held[entry] = {**row, "replaced_at": None}
        elif entry in held and held[entry]["replaced_at"] is None:
            held[entry]["replaced_at"] = row["births"]
    return [row for _, row in sorted(held.items()) if row["birth"] is not None]
