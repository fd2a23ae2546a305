"""Writes segments of tables with their checksums, as a run does."""

from collections.abc import Iterable
from pathlib import Path
from zlib import crc32

import pyarrow as pa

from schema.tables.checksums import CHECK, FIELDS, MAGIC, sums_path


def write_segment(
    path: Path, schema: pa.Schema, batches: Iterable[pa.RecordBatch]
) -> list[int]:
    """Write a segment and its checksums; return the ends of its messages."""
    path.parent.mkdir(parents=True, exist_ok=True)
    data, sums, ends = b"", MAGIC, []
    for message in (schema, *batches):
        piece = message.serialize().to_pybytes()
        data += piece
        fields = FIELDS.pack(len(data), crc32(piece))
        sums += fields + CHECK.pack(crc32(fields))
        ends.append(len(data))
    path.write_bytes(data)
    sums_path(path).write_bytes(sums)
    return ends
