"""Tables of earlier versions, which lack some columns."""

from collections.abc import Mapping

import pyarrow as pa


def is_earlier(found: pa.Schema, schema: pa.Schema) -> bool:
    """Return whether a schema is that of a table, now or before it got new columns.

    Args:
        found: schema of stored rows, with metadata.
        schema: present schema of the table.
    """
    known = pa.schema([field for field in schema if field.name in found.names])
    missing = [field for field in schema if field.name not in found.names]
    return (
        found.equals(known)
        # Units and descriptions of earlier versions were other texts, or none.
        and [_fixed(each) for each in found] == [_fixed(each) for each in known]
        and [found.metadata.get(key) for key in _IDENTITY]
        == [schema.metadata[key] for key in _IDENTITY]
        and all(field.nullable or b"absent" in field.metadata for field in missing)
    )


_IDENTITY = (b"revolve.schema", b"revolve.schema_version")


def _fixed(field: pa.Field) -> tuple[bytes | None, ...]:
    metadata = field.metadata or {}
    return metadata.get(b"repeatable"), metadata.get(b"absent")


def absent_value(field: pa.Field) -> int | None:
    """Return the value of a column in rows that are older than it; None is null."""
    absent = field.metadata.get(b"absent")
    return absent and int(absent)


def completed(
    rows: pa.Table, schema: pa.Schema, of_run: Mapping[str, object]
) -> pa.Table:
    """Return rows with the columns added that they lack.

    Args:
        rows: of a table.
        schema: present schema of the table.
        of_run: values of columns that are the same in all rows of the run.

    Raises:
        ValueError: the rows are not of the table.
    """
    missing = [field for field in schema if field.name not in rows.column_names]
    for field in missing:
        value = pa.scalar(of_run.get(field.name, absent_value(field)), field.type)
        rows = rows.append_column(field, pa.repeat(value, rows.num_rows))
    # Parquet has its own name for the items of a list.
    return rows.select(schema.names).cast(schema)
