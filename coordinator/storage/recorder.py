"""Writer of all tables of a run: Arrow segments while it runs, Parquet at its end.

Rows are a function of the journal. A replay passes the same rows in the same order, and
those that are already on disk are skipped by their number.
"""

import contextlib
import logging
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import Any
from zlib import crc32

import pyarrow as pa
import pyarrow.parquet

from coordinator.islands.events import Advanced, Record
from coordinator.storage.disk import AppendedFile, storage_errors
from coordinator.storage.rewriting import cut_segment, remove_rows, remove_segment
from schema.errors import RunFolderError
from schema.tables.checksums import CHECK, FIELDS, MAGIC, digest_of, sums_path
from schema.tables.columns import ROWS, TABLES
from schema.tables.description import RunDetails, run_columns
from schema.tables.files import (
    batches_by_island,
    damage_of,
    in_groups,
    parquet_path,
    read_table,
    stored_rows,
)
from schema.tables.replacement import install_new, new_path, write_new
from schema.tables.segments import SEGMENTS, segment_path, segments_of
from schema.wire.arena import NO_POSES
from schema.wire.poses import PoseArrays

_LOG = logging.getLogger(__name__)

BUFFERED = 64
"""Rows of a table that are buffered before they are written together."""


class Recorder:
    """Writer of a run's tables; rows arrive in their repeatable order.

    Attributes:
        poses: table of the poses; only before a replay counts any are they removed or
            written here.
    """

    def __init__(
        self,
        folder: Path,
        details: RunDetails,
        *,
        fsync: bool = False,
        seal: Callable[[Mapping[str, str]], None] = lambda _: None,
    ) -> None:
        """Open the tables of a run folder that this process has locked.

        Damaged rows are removed, and all rows behind them in their table.

        ``details`` name the Parquet files; with ``fsync`` rows survive power loss, too;
        ``seal`` stores the SHA-256 of finished tables before they get their names.

        Raises:
            RunFolderError: a segment has another version, or the disk fails.
        """
        self._folder = folder
        self._seal = seal
        with storage_errors(folder):
            (folder / SEGMENTS).mkdir(exist_ok=True)
        self._tables = {
            name: TableFile(
                folder,
                name,
                parquet_path(folder, details.name, details.run, name),
                fsync=fsync,
            )
            for name in TABLES
        }
        self.poses = self._tables["poses"]

    def write(self, record: Record) -> None:
        """Add one row, with every column except ``record``; it may be buffered."""
        table = self._tables[record.table]
        table.take(record.row)
        if len(table.buffered) >= BUFFERED:
            table.flush()

    def flush(self) -> None:
        """Write all buffered rows to disk."""
        for table in self._tables.values():
            table.flush()

    def finish(self) -> None:
        """Convert all segments to Parquet, then remove them.

        After a kill at any point, each table is complete in one of the two forms: open
        the run again, replay, and finish again.
        """
        self.flush()
        prepared = {name: table.prepare() for name, table in self._tables.items()}
        digests = {name: digest for name, digest in prepared.items() if digest}
        if digests:
            self._seal(digests)
        for table in self._tables.values():
            table.finish()
        self.close()
        for name in TABLES:
            for _, path in segments_of(self._folder, name):
                remove_segment(path)
        # Fails if the folder holds foreign files; they stay.
        with contextlib.suppress(OSError):
            (self._folder / SEGMENTS).rmdir()

    def close(self) -> None:
        """Close all files; buffered rows are dropped, a replay adds them again."""
        for table in self._tables.values():
            table.close()


class TableFile:
    """Writer of one table.

    A table gets single rows, which are buffered, or the poses of whole advances.

    Attributes:
        stored: number of rows on disk.
        buffered: rows that are not on disk yet.
    """

    def __init__(self, folder: Path, name: str, parquet: Path, *, fsync: bool) -> None:
        self._folder = folder
        self._name = name
        self._parquet = parquet
        self._fsync = fsync
        self._schema = TABLES[name]
        self._of_run = run_columns(folder)
        self._segment: Segment | None = None
        self._seen = 0
        self._ahead = 0
        self.buffered: list[Mapping[str, Any]] = []
        if parquet.exists() and not self._set_aside():
            self.stored: int = read_table(folder, name, ["record"]).num_rows
            return
        stored = stored_rows(folder, name)
        self.stored = stored.rows
        for path, last in stored.used.items():
            cut_segment(path, last)
        for path in stored.unused:
            remove_segment(path)

    def _set_aside(self) -> bool:
        """Rename the finished file, to write it again, if it is damaged; tell if so."""
        if not (why := damage_of(self._folder, self._name)):
            return False
        aside = _aside(self._parquet)
        with storage_errors(self._parquet):
            self._parquet.replace(aside)
        _LOG.warning("%s; until then it is kept as %s", why, aside.name)
        return True

    def take(self, row: Mapping[str, Any]) -> None:
        """Add the next row, unless it is already on disk."""
        if self._seen >= self.stored:
            self.buffered.append(row)
        self._seen += 1

    def store(self, event: Advanced) -> None:
        """Write the poses of an advance to disk before the journal gets it.

        Those that an earlier process stored without their event are removed first.
        """
        self.keep(self._seen + self._ahead)
        if event.pose_rows:
            self.add(_poses_of(event))
            self._ahead += event.pose_rows

    def take_advance(self, event: Advanced) -> None:
        """Count the poses of an advance in the journal; write them unless on disk.

        Raises:
            RunFolderError: they are neither on disk nor in the event.
        """
        end = self._seen + event.pose_rows
        if self.stored < end:
            if event.advance.poses == NO_POSES:
                raise RunFolderError(
                    f"{self._folder / SEGMENTS}: {self._name}: rows {self.stored} to "
                    f"{end - 1} are missing, and the journal does not hold them: "
                    "resume the run to compute them again"
                )
            self.store(event)
        self._seen = end
        self._ahead = max(0, self._ahead - event.pose_rows)

    def restore(self, event: Advanced) -> None:
        """Write the next poses behind those on disk; errors as of ``add``."""
        self.add(_poses_of(event))

    def add(self, rows: pa.Table) -> None:
        """Write rows as one batch; columns of the run get this run's values."""
        own = {name for name in rows.column_names if name in ROWS[self._name].names}
        columns = {name: rows[name].combine_chunks() for name in own}
        self._write(self._numbered(columns, rows.num_rows))

    def keep(self, rows: int) -> None:
        """Remove all rows on disk from a number on, as ``remove_rows``."""
        if self.stored > rows:
            remove_rows(self._folder, self._name, rows)
            self.stored = rows

    def flush(self) -> None:
        """Write the buffered rows as one batch, all or none."""
        if rows := self.buffered:
            columns = {
                each.name: pa.array([row[each.name] for row in rows], each.type)
                for each in ROWS[self._name]
            }
            self._write(self._numbered(columns, len(rows)))
            self.buffered = []

    def prepare(self) -> str:
        """Write all rows as Parquet under another name; return the file's SHA-256.

        In hexadecimal; empty if the table has its final form already.
        """
        if self._parquet.exists():
            return ""
        rows = stored_rows(self._folder, self._name).rows
        if rows != self.stored:
            raise RunFolderError(
                f"{self._folder / SEGMENTS}: {self._name}: must hold {self.stored} "
                f"rows, got {rows}: resume the run to write them again"
            )
        with storage_errors(self._parquet):
            self._parquet.parent.mkdir(parents=True, exist_ok=True)
            write_new(self._parquet, self._write_parquet)
        return digest_of(new_path(self._parquet))

    def finish(self) -> None:
        """Give the Parquet file its final name."""
        aside = _aside(self._parquet)
        with storage_errors(self._parquet):
            if not self._parquet.exists():
                install_new(self._parquet)
            if aside.exists():
                aside.unlink()

    def close(self) -> None:
        """Close the segment."""
        if self._segment is not None:
            self._segment.close()

    def _write_parquet(self, path: Path) -> None:
        parts = in_groups(batches_by_island(self._folder, self._name))
        write_parquet(path, self._name, parts)

    def _write(self, batch: pa.RecordBatch) -> None:
        """Append a batch to the segment, all or nothing."""
        if self._parquet.exists():
            raise RunFolderError(
                f"{self._parquet}: finished with {self.stored} rows, got more"
            )
        if self._segment is None:
            self._segment = self._opened()
        self._segment.append(batch)
        self.stored += batch.num_rows

    def _opened(self) -> "Segment":
        """Return a new segment that contains the schema."""
        numbers = [number for number, _ in segments_of(self._folder, self._name)]
        path = segment_path(self._folder, self._name, max(numbers, default=-1) + 1)
        return Segment(path, self._schema, fsync=self._fsync)

    def _numbered(self, columns: dict[str, pa.Array], rows: int) -> pa.RecordBatch:
        """Return a batch of the next rows, with record numbers and those of the run."""
        columns["record"] = pa.array(range(self.stored, self.stored + rows), pa.int64())
        for each in self._schema:
            if each.name not in columns:
                value = pa.scalar(self._of_run[each.name], each.type)
                columns[each.name] = pa.repeat(value, rows)
        arrays = [columns[name] for name in self._schema.names]
        return pa.RecordBatch.from_arrays(arrays, schema=self._schema)


def write_parquet(path: Path, table: str, parts: Iterable[pa.Table]) -> None:
    """Write all rows of a table as Parquet, one part in memory at a time."""
    with pa.parquet.ParquetWriter(
        path, TABLES[table], compression="zstd", write_page_checksum=True
    ) as file:
        for part in parts:
            file.write_table(part)


def _poses_of(event: Advanced) -> pa.Table:
    return PoseArrays.received(event.advance.poses).rows(event.island)


def _aside(parquet: Path) -> Path:
    """Return the name of a damaged file until it is written again."""
    return parquet.with_name(f"{parquet.name}.damaged")


class Segment:
    """A new segment of a table, open for appending."""

    def __init__(self, path: Path, schema: pa.Schema, *, fsync: bool = False) -> None:
        """Create the files of a segment, which must not exist, with its schema."""
        # In this order, a segment without checksums is always damage.
        self._sums = AppendedFile(sums_path(path), fsync=fsync)
        self._file = AppendedFile(path, fsync=fsync)
        try:
            self._sums.append(MAGIC)
            self._append(schema.serialize())
        except RunFolderError:
            self.close()
            raise

    def append(self, batch: pa.RecordBatch) -> None:
        """Append a batch, all or nothing."""
        self._append(batch.serialize())

    def _append(self, message: pa.Buffer) -> None:
        data = memoryview(message)
        self._file.append(data)
        try:
            self._sums.append(_record(self._file.size, data))
        except RunFolderError:
            self._file.cut(self._file.size - len(data))
            raise

    def close(self) -> None:
        """Close both files."""
        self._file.close()
        self._sums.close()


def _record(end: int, message: memoryview) -> bytes:
    """Return the checksum record of a message that ends at a byte of its segment."""
    fields = FIELDS.pack(end, crc32(message))
    return fields + CHECK.pack(crc32(fields))
