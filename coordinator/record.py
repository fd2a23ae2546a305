"""Table rows to disk: segments while a run lives, Parquet when it is done.

Rows are a function of the journal: a replay hands in the same rows again in the
same order, and those that already stand on disk are passed over by their number.
"""

import contextlib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.parquet

from coordinator.disk import AppendedFile, replace_durably, storage_error
from coordinator.events import Record
from coordinator.folder import RunDetails
from schema.errors import RunFolderError
from schema.run_tables import (
    SEGMENTS,
    parquet_path,
    read_chain,
    read_table,
    segment_path,
    segments_of,
)
from schema.tables import TABLES

WAITING = 64
"""Rows of one table that wait for each other before they are written."""

ROW_GROUP = 50_000


class Recorder:
    """Takes rows in their repeatable order and brings them to disk."""

    def __init__(
        self, folder: Path, details: RunDetails, *, fsync: bool = False
    ) -> None:
        """Open the tables of a run folder that this process holds.

        Args:
            folder: the run folder.
            details: names the finished tables.
            fsync: survive power loss, too.

        Raises:
            RunFolderError: a segment of another version, or a disk that fails.
        """
        self._folder = folder
        paths = {
            name: parquet_path(folder, details.name, details.run, name)
            for name in TABLES
        }
        try:
            (folder / SEGMENTS).mkdir(exist_ok=True)
        except OSError as error:
            raise storage_error(folder, error) from None
        self._tables = {
            name: _Table(folder, name, paths[name], fsync=fsync) for name in TABLES
        }

    def write(self, record: Record) -> None:
        """Take one row; it may wait for others before it is on disk.

        Args:
            record: ``row`` has every column of the table but ``record``.

        Raises:
            RunFolderError: the disk is full or failed; the row still waits.
        """
        table = self._tables[record.table]
        table.take(record.row)
        if len(table.waiting) >= WAITING:
            table.flush()

    def flush(self) -> None:
        """Bring all rows to disk.

        Raises:
            RunFolderError: the disk is full or failed; no row is lost.
        """
        for table in self._tables.values():
            table.flush()

    def finish(self) -> None:
        """Turn all segments into Parquet; they go when all of it is durable.

        A kill at any point leaves either form of every table whole: open the run
        again, replay, and finish again.

        Raises:
            RunFolderError: the disk is full or failed; the segments still stand.
        """
        self.flush()
        for table in self._tables.values():
            table.finish()
        self.close()
        try:
            for name in TABLES:
                for _, path in segments_of(self._folder, name):
                    path.unlink()
            # Nothing of ours is left in it; whatever else is there may stay.
            with contextlib.suppress(OSError):
                (self._folder / SEGMENTS).rmdir()
        except OSError as error:
            raise storage_error(self._folder / SEGMENTS, error) from None

    def close(self) -> None:
        """Close all files; rows that wait are dropped, a replay brings them again."""
        for table in self._tables.values():
            table.close()


class _Table:
    """One table: rows that wait, rows on disk, and the segment that grows."""

    def __init__(self, folder: Path, name: str, parquet: Path, *, fsync: bool) -> None:
        self._folder = folder
        self._name = name
        self._parquet = parquet
        self._fsync = fsync
        self._schema = TABLES[name]
        self._columns = self._schema.names[1:]
        self._segment: AppendedFile | None = None
        self._seen = 0
        self.waiting: list[Mapping[str, Any]] = []
        if parquet.exists():
            self._stored: int = read_table(folder, name).num_rows
            return
        chain, unused = read_chain(folder, name)
        self._stored = sum(batch.num_rows for batch in chain)
        try:
            for _, path in unused:
                path.unlink()
        except OSError as error:
            raise storage_error(folder, error) from None

    def take(self, row: Mapping[str, Any]) -> None:
        """Take the next row, unless it stands on disk already."""
        if self._seen >= self._stored:
            self.waiting.append(row)
        self._seen += 1

    def flush(self) -> None:
        """Write the waiting rows as one batch, whole or not at all."""
        if not self.waiting:
            return
        if self._parquet.exists():
            raise RunFolderError(
                f"{self._parquet}: finished with {self._stored} rows, and more came"
            )
        if self._segment is None:
            self._segment = self._opened()
        self._segment.append(self._batch().serialize().to_pybytes())
        self._stored += len(self.waiting)
        self.waiting = []

    def finish(self) -> None:
        """Write all rows as Parquet, unless that is done."""
        if self._parquet.exists():
            return
        table = read_table(self._folder, self._name)
        if table.num_rows != self._stored:
            raise RunFolderError(
                f"{self._folder / SEGMENTS}: {self._name}: must hold {self._stored} "
                f"rows, got {table.num_rows}: resume the run to write them again"
            )
        replace_durably(
            self._parquet,
            lambda path: pa.parquet.write_table(
                table, path, compression="zstd", row_group_size=ROW_GROUP
            ),
        )

    def close(self) -> None:
        """Close the segment."""
        if self._segment is not None:
            self._segment.close()

    def _opened(self) -> AppendedFile:
        """Return a new segment that holds the schema."""
        numbers = [number for number, _ in segments_of(self._folder, self._name)]
        number = max(numbers, default=-1) + 1
        path = segment_path(self._folder, self._name, number)
        segment = AppendedFile(path, fsync=self._fsync)
        segment.append(self._schema.serialize().to_pybytes())
        return segment

    def _batch(self) -> pa.RecordBatch:
        """Return the waiting rows as columns."""
        rows = self.waiting
        numbers = range(self._stored, self._stored + len(rows))
        arrays = [pa.array(numbers, self._schema.field(0).type)]
        for index, column in enumerate(self._columns, start=1):
            kind = self._schema.field(index).type
            arrays.append(pa.array([row[column] for row in rows], kind))
        return pa.RecordBatch.from_arrays(arrays, schema=self._schema)
