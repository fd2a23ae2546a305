"""Finished tables of earlier versions, which lack some columns."""

from collections.abc import Mapping

import pyarrow as pa


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
        # Of rows that are older than a column; otherwise they have null.
        absent = field.metadata.get(b"absent")
        value = pa.scalar(of_run.get(field.name, absent and int(absent)), field.type)
        rows = rows.append_column(field, pa.repeat(value, rows.num_rows))
    # Parquet has its own name for the items of a list.
    return rows.select(schema.names).cast(schema)
