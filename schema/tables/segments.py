"""Segments of a table: Arrow streams of an unfinished run, checked before parsing.

The first damaged batch of a segment ends its sound part. What is damaged is named once
per process; the rows before it are read. Resuming the run computes the others again.
"""

import logging
import re
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import NamedTuple

import pyarrow as pa

from schema.errors import RunFolderError
from schema.tables.checksums import Damaged, sound_messages, sums_path
from schema.tables.columns import TABLES

SEGMENTS = "segments"
FINISHED = "tables"

_LOG = logging.getLogger(__name__)

_VERSION = b"revolve.schema_version"
_NAME = re.compile(r"([a-z]+)-(\d+)\.(?:arrows|sums)")


class Batch(NamedTuple):
    """A batch of a segment.

    Attributes:
        end: of its bytes in the segment.
        messages: number of messages up to it, that of the schema included.
        rows: with all columns of the table.
    """

    end: int
    messages: int
    rows: pa.RecordBatch

    @property
    def numbers(self) -> range:
        """Record numbers of the rows; they are consecutive."""
        first = self.rows["record"][0].as_py() if self.rows.num_rows else 0
        return range(first, first + self.rows.num_rows)


def segment_path(folder: Path, table: str, number: int) -> Path:
    """Return the path of a segment of a table."""
    return folder / SEGMENTS / f"{table}-{number:03d}.arrows"


def segments_of(folder: Path, table: str) -> list[tuple[int, Path]]:
    """Return number and path of each segment of a table, in order.

    One whose file is lost, but not its checksums, is included.
    """
    found = (_NAME.fullmatch(path.name) for path in (folder / SEGMENTS).glob("*"))
    numbers = {int(match[2]) for match in found if match and match[1] == table}
    return [(each, segment_path(folder, table, each)) for each in sorted(numbers)]


def parquet_files(folder: Path, table: str) -> list[Path]:
    """Return the Parquet files of a table: one if the run is finished, or none."""
    return sorted((folder / FINISHED).glob(f"*/*/{table}.parquet"))


def read_segment(folder: Path, table: str, path: Path) -> Iterator[Batch]:
    """Yield the complete batches of a segment, up to the first damaged one."""
    try:
        yield from _batches(path, TABLES[table])
    except Damaged as damage:
        # At the end of a run, segments are removed as soon as there is Parquet.
        if not parquet_files(folder, table):
            warn_once(
                f"{damage}; its rows from there on are left out: to compute them "
                "again, resume the run"
            )
    except OSError as error:
        why = error.strerror or error
        raise RunFolderError(f"{path}: cannot be read: {why}") from None


@cache
def warn_once(line: str) -> None:
    """Log a warning, once per process."""
    _LOG.warning("%s", line)


def _batches(path: Path, schema: pa.Schema) -> Iterator[Batch]:
    """Yield the batches whose bytes have the right checksum, up to the first damage."""
    try:
        sums = sums_path(path).read_bytes()
    except FileNotFoundError:
        raise Damaged(sums_path(path), 0, "the file is missing") from None
    for number, (end, message) in enumerate(sound_messages(path, sums), start=1):
        if number > 1:
            yield Batch(end, number, pa.ipc.read_record_batch(message, schema))
        elif not _is_same(pa.ipc.read_schema(message), schema):
            raise RunFolderError(
                f"{path}: was written by another version of Revolve: finish the run "
                "with that version"
            )


def _is_same(stored: pa.Schema, schema: pa.Schema) -> bool:
    """Return whether two schemas differ in descriptions and units at most."""
    versions = [(each.metadata or {}).get(_VERSION) for each in (stored, schema)]
    return stored.equals(schema) and versions[0] == versions[1]
