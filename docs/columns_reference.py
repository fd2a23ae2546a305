"""Text of docs/reference/columns.md: every column of every table, from its schema."""

from collections.abc import Iterator

import pyarrow as pa

from docs.struct_tables import attributes
from schema.robot.robot import Part
from schema.tables.columns import PART, TABLES

_HEAD = """# Columns of the tables

Written from the code by `python -m docs.reference_pages`. [Tables](../tables.md) shows
how to read them. Unit and description are also in the metadata of each column.

Units are symbols; numbers of things, counts, names and bytes have none. A column that
is not repeatable depends on machines and clocks; all others are equal, row by row, in
two runs of the same experiment and seed. A column without the mark null has a value in
every row.

"""
_OF_PART = {"child_slot": "slot", "rot": "orientation", "params": "parameters"}
"""Attributes of a part that have other names in tables."""


def page() -> str:
    """Return the page."""
    lines = [line for name, schema in TABLES.items() for line in _table(name, schema)]
    return _HEAD + "\n".join([*lines, *_part()]) + "\n"


def _table(name: str, schema: pa.Schema) -> Iterator[str]:
    """Yield the lines about a table."""
    yield f"## `{name}`\n"
    yield f"Each row is {schema.metadata[b'description'].decode()}.\n"
    yield "| column | type | unit | meaning |"
    yield "|---|---|---|---|"
    for field in schema:
        unit, meaning = (_noted(field, key) for key in ("unit", "description"))
        if not meaning:
            raise ValueError(f"{name}.{field.name}: has no description")
        if _noted(field, "repeatable") != "true":
            meaning += " (not repeatable)"
        kind = f"{_type(field.type)}, null" if field.nullable else _type(field.type)
        yield f"| `{field.name}` | {kind} | {unit} | {meaning} |"
    yield ""


def _noted(field: pa.Field, key: str) -> str:
    return str(field.metadata[key.encode()].decode()).replace("|", "\\|")


def _type(kind: pa.DataType) -> str:
    """Return a type as Arrow names it; a part has a table of its own."""
    if kind == PART:
        return "[part](#parts-of-bodies)"
    if pa.types.is_list(kind):
        return f"list of {_type(kind.value_type)}"
    if pa.types.is_struct(kind):
        return ", ".join(f"`{each.name}` {_type(each.type)}" for each in kind)
    if pa.types.is_map(kind):
        return f"map of {kind.key_type} to {_type(kind.item_type)}"
    return {"double": "float64", "float": "float32"}.get(str(kind), str(kind))


def _part() -> Iterator[str]:
    """Yield the lines about the fields of a part."""
    meanings = {"idx": "index of the part; the core's is 0", **attributes(Part)}
    yield "## Parts of bodies\n"
    yield "| field | type | meaning |"
    yield "|---|---|---|"
    for field in PART:
        meaning = meanings[_OF_PART.get(field.name, field.name)].removesuffix(".")
        yield f"| `{field.name}` | {_type(field.type)} | {meaning} |"
