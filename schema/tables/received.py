"""Arrow columns of another process, checked before their rows are used.

Arrow verifies the structure of each message, but it decompresses what it is given, so
compressed columns are refused before it does.
"""

from collections.abc import Iterator
from struct import Struct

import pyarrow as pa

from schema.errors import MalformedMessage
from schema.tables.columns import ROWS

_U16, _I32, _U32, _I64 = map(Struct, ("<H", "<i", "<I", "<q"))
_HEADER = 2
"""Field of a ``Message`` of the format: its ``RecordBatch``."""
_LENGTH, _COMPRESSION = 0, 3
"""Fields of a ``RecordBatch``: number of rows, and how its buffers are compressed."""
_MOST_BATCHES = 16


def read_columns(table: str, columns: bytes) -> pa.Table:
    """Return the rows of an Arrow stream.

    Args:
        table: name of their table.
        columns: Arrow IPC stream of the columns in ``ROWS``; empty for no rows.

    Raises:
        MalformedMessage: not such a stream, or columns of other names or types.
    """
    schema = ROWS[table]
    if not columns:
        return schema.empty_table()
    try:
        with pa.ipc.open_stream(columns) as reader:
            found = reader.read_all()
        if not found.schema.equals(schema):
            raise MalformedMessage(
                f"{table}: columns must be {_described(schema)}, got "
                f"{_described(found.schema)}"
            )
        found.validate(full=True)
    except (pa.ArrowException, OSError) as error:
        raise MalformedMessage(f"{table}: not an Arrow stream: {error}") from None
    return found


def _described(schema: pa.Schema) -> str:
    return ", ".join(f"{field.name}: {field.type}" for field in schema)


def received_columns(
    table: str, columns: bytes, *, most_bytes: int, most_rows: int
) -> pa.Table:
    """Return the rows of an Arrow stream that another process made.

    Args:
        table: name of their table.
        columns: Arrow IPC stream of the columns in ``ROWS``, not compressed; empty for
            no rows.
        most_bytes: length that it may have.
        most_rows: number of rows that it may have.

    Raises:
        MalformedMessage: not such a stream; columns of other names or types; nulls in
            a column that has none; too many bytes or rows.
    """
    schema = ROWS[table]
    if not columns:
        return schema.empty_table()
    if len(columns) > most_bytes:
        raise MalformedMessage(
            f"{table}: must be <= {most_bytes} bytes, got {len(columns)}", "too large"
        )
    try:
        batches = list(_batches(table, columns, most_rows))
        rows = pa.Table.from_batches(batches, schema)
        rows.validate(full=True)
    # A name that is not UTF-8 and a size that no array can have are errors of Python.
    except (pa.ArrowException, OSError, ValueError, OverflowError) as error:
        raise MalformedMessage(f"{table}: not an Arrow stream: {error}") from None
    _check_nulls(table, rows)
    return rows


def _batches(table: str, columns: bytes, most_rows: int) -> Iterator[pa.RecordBatch]:
    schema = ROWS[table]
    messages = iter(pa.ipc.MessageReader.open_stream(columns))
    first = next(messages, None)
    if first is None or first.type != "schema":
        raise MalformedMessage(f"{table}: not an Arrow stream: has no schema")
    # Another byte order would be converted before the columns are validated.
    if not pa.ipc.read_schema(first).equals(schema):
        raise MalformedMessage(f"{table}: has other columns than the table")
    rows = 0
    for count, message in enumerate(messages, start=1):
        if message.type != "record batch" or count > _MOST_BATCHES:
            raise MalformedMessage(
                f"{table}: must have <= {_MOST_BATCHES} record batches and nothing else"
            )
        length, is_compressed = _batch_header(message.metadata.to_pybytes())
        rows += length
        if is_compressed:
            raise MalformedMessage(f"{table}: columns must not be compressed")
        if not 0 <= length <= rows <= most_rows:
            raise MalformedMessage(
                f"{table}: must have <= {most_rows} rows, got {rows}", "too large"
            )
        yield pa.ipc.read_record_batch(message, schema)


def _batch_header(metadata: bytes) -> tuple[int, bool]:
    """Return the number of rows of a record batch, and whether it is compressed.

    Args:
        metadata: of a message, whose structure Arrow has verified.

    Source: ``Message.fbs`` of Apache Arrow, and the binary format of FlatBuffers.
    """
    (message,) = _U32.unpack_from(metadata)
    place = _field(metadata, message, _HEADER)
    batch = place + _U32.unpack_from(metadata, place)[0]
    place = _field(metadata, batch, _LENGTH)
    length = _I64.unpack_from(metadata, place)[0] if place else 0
    return length, _field(metadata, batch, _COMPRESSION) > 0


def _field(metadata: bytes, table: int, number: int) -> int:
    """Return the position of a field of a FlatBuffers table; 0 if it is absent."""
    fields = table - _I32.unpack_from(metadata, table)[0]
    entry = 4 + 2 * number
    if entry >= _U16.unpack_from(metadata, fields)[0]:
        return 0
    (offset,) = _U16.unpack_from(metadata, fields + entry)
    return table + offset if offset else 0


def _check_nulls(table: str, rows: pa.Table) -> None:
    """Raise if a column or a list has a null that its type does not allow.

    Raises:
        MalformedMessage: it has.
    """
    for field in rows.schema:
        column = rows[field.name]
        has_null = column.null_count and not field.nullable
        if pa.types.is_list(field.type) and not has_null:
            has_null = any(chunk.values.null_count for chunk in column.chunks)
        if has_null:
            raise MalformedMessage(f"{table}.{field.name}: must not be null")
