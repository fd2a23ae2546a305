"""Reads what runs left behind, finished or not."""

import json
from pathlib import Path

import pyarrow as pa

from schema.errors import RunFolderError
from schema.run_tables import read_table

_DETAILS = "run.json"


def run_folders(roots: list[Path]) -> list[Path]:
    """Return the run folders at or below some folders, in order of their paths.

    Raises:
        RunFolderError: there is none.
    """
    found = sorted(
        {path.parent for root in roots for path in root.glob(f"**/{_DETAILS}")}
    )
    if not found:
        names = ", ".join(map(str, roots))
        raise RunFolderError(f"{names}: no run is there or below")
    return found


def load_table(folders: list[Path], name: str) -> pa.Table:
    """Return one table of several runs, with whose rows they are.

    Args:
        folders: run folders.
        name: of the table.

    Returns:
        The table's columns, ``experiment`` (its name), ``folder`` (the run's) and
        ``is_online`` (the run is an arena).

    Raises:
        RunFolderError: a folder whose run cannot be told, or a table that cannot
            be read.
    """
    return pa.concat_tables([_owned(folder, name) for folder in folders])


def _owned(folder: Path, name: str) -> pa.Table:
    try:
        details = json.loads((folder / _DETAILS).read_text(encoding="utf-8"))
        experiment = str(details["name"])
        is_online = json.loads(details["document"])["arena"] is not None
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise RunFolderError(f"{folder / _DETAILS}: cannot be read: {error}") from None
    table = read_table(folder, name)
    owned = {"experiment": experiment, "folder": str(folder), "is_online": is_online}
    for column, value in owned.items():
        filled = pa.repeat(pa.scalar(value), table.num_rows)
        table = table.append_column(column, filled)
    return table
