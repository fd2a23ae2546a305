"""Builders of small tables of a run."""

from typing import Any

import pyarrow as pa

from schema.tables.columns import TABLES
from tests.analysis.bodies import Body, part

CORE: Body = [part(0, -1, -1, "Core")]


def table(name: str, rows: list[dict[str, Any]]) -> pa.Table:
    """Return rows of a table; missing columns are 0, empty or null."""
    made = TABLES[name]
    filled = []
    for record, row in enumerate(rows):
        blanks = {field.name: blank(field) for field in made}
        home = {"birth_island": row.get("island", 0)}
        filled.append({**blanks, "record": record, **home, **row})
    return pa.Table.from_pylist(filled, made)


def blank(field: pa.Field) -> object:
    """Return 0, empty or null."""
    if field.nullable:
        return None
    if pa.types.is_list(field.type):
        return []
    if pa.types.is_binary(field.type):
        return b""
    if pa.types.is_boolean(field.type):
        return False
    return "" if pa.types.is_string(field.type) else 0


Name = tuple[int, int]


def births(*rows: tuple[Name, list[Name]], **columns: list[Any]) -> pa.Table:
    """Return births of (island, birth) with their parents, and further columns."""
    made = []
    for index, ((island, birth), parents) in enumerate(rows):
        named = [{"island": home, "birth": number} for home, number in parents]
        row = {"island": island, "birth": birth, "parents": named, "body": CORE}
        more = {name: values[index] for name, values in columns.items()}
        made.append({**row, "parts": 1, **more})
    return table("births", made)


def population(
    *levels: tuple[int, int, dict[Name, float | None]], is_online: bool = False
) -> pa.Table:
    """Return recorded populations: (island, births, fitness by birth id)."""
    names = ("island", "births", "birth_island", "birth", "fitness")
    rows = [
        dict(zip(names, (island, count, home, birth, fitness), strict=True))
        for island, count, living in levels
        for (home, birth), fitness in living.items()
    ]
    made = table("population", rows)
    return made.append_column("is_online", pa.repeat(is_online, len(rows)))


def run(**tables: pa.Table) -> dict[str, pa.Table]:
    """Return all tables of a run; those that are not named are empty."""
    names = ("evaluations", "fitness", "deaths", "touches", "migrations")
    return {**{name: table(name, []) for name in names}, **tables}
