"""Segments of a table: Arrow streams of an unfinished run, checked before parsing.

The first damaged batch of a segment ends its sound part. What is damaged is named once
per process; the rows before it are read. Resuming the run computes the others again.
"""

import contextlib
import logging
import re
from collections.abc import Iterator, Mapping
from functools import cache, partial
from pathlib import Path
from typing import NamedTuple

import pyarrow as pa

from schema.errors import RunFolderError
from schema.tables.checksums import Damaged, read_seal, sound_messages, sums_path
from schema.tables.columns import TABLES
from schema.tables.description import run_columns
from schema.tables.earlier import completed, is_earlier

SEGMENTS = "segments"
FINISHED = "tables"

_LOG = logging.getLogger(__name__)
_NOTED: list[Path] = []
"""The first run folder without checksums that this process has read."""

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
    """Yield the complete batches of a segment, up to the first damaged one.

    Args:
        folder: the run folder.
        table: name of the table.
        path: the segment.

    Raises:
        RunFolderError: the segment is of another version of its table, or the disk
            fails.
    """
    try:
        sums = _sums(folder, path)
        batches = _unchecked if sums is None else _checked
        whole = partial(_whole, schema=TABLES[table], of_run=run_columns(folder))
        for batch in batches(path, TABLES[table], sums or b""):
            yield batch._replace(rows=whole(batch.rows))
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


def note_unchecked(folder: Path) -> None:
    """Log that a run of an earlier version has no checksums, for the first such run."""
    if not _NOTED:
        _NOTED.append(folder)
        _LOG.warning(
            "%s: has no checksums, as all runs of earlier versions: damage in their "
            "tables may not be noticed",
            folder,
        )


def _sums(folder: Path, path: Path) -> bytes | None:
    """Return the checksums of a segment; None if it is older than checksums.

    Raises:
        Damaged: they are missing.
    """
    try:
        return sums_path(path).read_bytes()
    except FileNotFoundError:
        if read_seal(folder).checksums:
            raise Damaged(sums_path(path), 0, "the file is missing") from None
    note_unchecked(folder)
    return None


def _checked(path: Path, schema: pa.Schema, sums: bytes) -> Iterator[Batch]:
    """Yield the batches whose bytes have the right checksum.

    Raises:
        Damaged: after the last of them.
        RunFolderError: the segment is of another version of its table.
    """
    stored: pa.Schema | None = None
    for number, (end, message) in enumerate(sound_messages(path, sums), start=1):
        if stored is None:
            stored = pa.ipc.read_schema(message)
            _check_version(path, stored, schema)
        else:
            batch = pa.ipc.read_record_batch(message, stored)
            yield Batch(end, number, batch)


def _unchecked(path: Path, schema: pa.Schema, _sums: bytes) -> Iterator[Batch]:
    """Yield the batches of a segment of an earlier version, which has no checksums.

    Raises:
        RunFolderError: the segment is of another version of its table.
    """
    # A truncated or damaged tail raises one of these; the batches before are whole.
    with (
        pa.OSFile(str(path)) as source,
        contextlib.suppress(pa.ArrowInvalid, OSError, MemoryError),
    ):
        reader = pa.ipc.open_stream(source)
        _check_version(path, reader.schema, schema)
        for number, batch in enumerate(reader, start=2):
            batch.validate(full=True)
            yield Batch(source.tell(), number, batch)


def _check_version(path: Path, found: pa.Schema, schema: pa.Schema) -> None:
    if not is_earlier(found, schema):
        raise RunFolderError(
            f"{path}: was written by another version of Revolve: finish the run "
            "with that version"
        )


def _whole(
    batch: pa.RecordBatch, schema: pa.Schema, of_run: Mapping[str, object]
) -> pa.RecordBatch:
    """Return a batch with all columns of its table."""
    if batch.schema.names == schema.names:
        return batch
    columns = completed(pa.Table.from_batches([batch]), schema, of_run).columns
    arrays = [column.combine_chunks() for column in columns]
    return pa.RecordBatch.from_arrays(arrays, schema=schema)
