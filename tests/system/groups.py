"""Comparison of the groups of an archipelago with a run of all its islands."""

from collections.abc import Sequence
from pathlib import Path

import pyarrow as pa

from schema.tables.columns import TABLES, repeatable
from schema.tables.files import read_table


def differing_tables(whole: Path, groups: Sequence[Path]) -> list[str]:
    """Return the tables whose rows differ in a repeatable column.

    The rows of each island must have the same order in both.
    """
    names = {name: repeatable(schema) for name, schema in TABLES.items()}
    return [
        name
        for name, columns in names.items()
        if "island" in columns
        and not _rows([whole], name, columns).equals(_rows(groups, name, columns))
    ]


def _rows(folders: Sequence[Path], name: str, columns: list[str]) -> pa.Table:
    """Return the rows of folders by island, without their record numbers."""
    order = [column for column in columns if column != "record"]
    tables = [read_table(folder, name, columns) for folder in folders]
    rows = pa.concat_tables(tables).sort_by(
        [("island", "ascending"), ("record", "ascending")]
    )
    return rows.select(order).combine_chunks()
