"""One table of a run on disk: segments while it lives, Parquet when it is done."""

import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.parquet

from coordinator.storage.disk import AppendedFile, replace_durably, storage_error
from schema.errors import MalformedMessage, RunFolderError
from schema.tables.columns import TABLES, read_columns
from schema.tables.files import (
    SEGMENTS,
    batch_ends,
    batches_by_island,
    read_table,
    segment_path,
    segments_of,
    stored_rows,
)

ROW_GROUP = 50_000


class TableFile:
    """One table: rows that wait, rows on disk, and the segment that grows.

    Rows come one by one, and wait for each other, or in bulk as columns; the rows
    of one table all come in the same way.

    Attributes:
        waiting: rows that are not on disk yet.
    """

    def __init__(self, folder: Path, name: str, parquet: Path, *, fsync: bool) -> None:
        self._folder = folder
        self._name = name
        self._parquet = parquet
        self._fsync = fsync
        self._schema = TABLES[name]
        self._columns = self._schema.names[1:]
        self._segment: AppendedFile | None = None
        self._seen = 0
        self._ahead = 0
        self.waiting: list[Mapping[str, Any]] = []
        if parquet.exists():
            self._stored: int = read_table(folder, name).num_rows
            return
        self._stored, unused = stored_rows(folder, name)
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

    def store(self, rows: int, columns: bytes) -> None:
        """Write bulk rows that nobody has counted yet."""
        known = self._seen + self._ahead
        if self._stored > known:
            cut_chain(self._folder, self._name, known)
            self._stored = known
        if rows:
            self._write(self._bulk(rows, columns))
            self._ahead += rows

    def take_columns(self, rows: int, columns: bytes) -> None:
        """Count the next bulk rows; write them unless they stand on disk already."""
        end = self._seen + rows
        if self._stored < end:
            if not columns:
                raise RunFolderError(
                    f"{self._folder / SEGMENTS}: {self._name}: rows {self._stored} to "
                    f"{end - 1} are missing, and the journal does not hold them: put "
                    "a sound copy of the segments in their place"
                )
            self.store(rows, columns)
        self._seen = end
        self._ahead = max(0, self._ahead - rows)

    def flush(self) -> None:
        """Write the waiting rows as one batch, whole or not at all."""
        if self.waiting:
            self._write(self._batch())
            self.waiting = []

    def finish(self) -> None:
        """Write all rows as Parquet, unless that is done."""
        if self._parquet.exists():
            return
        rows, _ = stored_rows(self._folder, self._name)
        if rows != self._stored:
            raise RunFolderError(
                f"{self._folder / SEGMENTS}: {self._name}: must hold {self._stored} "
                f"rows, got {rows}: resume the run to write them again"
            )
        replace_durably(self._parquet, self._write_parquet)

    def close(self) -> None:
        """Close the segment."""
        if self._segment is not None:
            self._segment.close()

    def _write_parquet(self, path: Path) -> None:
        """Write all rows, a group of them in memory at a time."""
        with pa.parquet.ParquetWriter(path, self._schema, compression="zstd") as file:
            waiting = self._schema.empty_table()
            for batch in batches_by_island(self._folder, self._name):
                waiting = pa.concat_tables([waiting, pa.Table.from_batches([batch])])
                while waiting.num_rows >= ROW_GROUP:
                    file.write_table(waiting.slice(0, ROW_GROUP))
                    waiting = waiting.slice(ROW_GROUP)
            if waiting.num_rows:
                file.write_table(waiting)

    def _write(self, batch: pa.RecordBatch) -> None:
        """Add a batch to the segment, whole or not at all."""
        if self._parquet.exists():
            raise RunFolderError(
                f"{self._parquet}: finished with {self._stored} rows, and more came"
            )
        if self._segment is None:
            self._segment = self._opened()
        self._segment.append(batch.serialize().to_pybytes())
        self._stored += batch.num_rows

    def _bulk(self, rows: int, columns: bytes) -> pa.RecordBatch:
        """Return bulk rows as one batch with their numbers."""
        table = read_columns(self._name, columns)
        if table.num_rows != rows:
            raise MalformedMessage(
                f"{self._name}: must be {rows} rows, got {table.num_rows}"
            )
        numbers = pa.array(range(self._stored, self._stored + rows), pa.int64())
        arrays = [numbers, *(column.combine_chunks() for column in table.columns)]
        return pa.RecordBatch.from_arrays(arrays, schema=self._schema)

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


def cut_chain(folder: Path, table: str, rows: int) -> None:
    """Drop all rows of a table from a number on; it is the first of a batch.

    Raises:
        RunFolderError: it is not, or the disk fails.
    """
    seen = 0
    try:
        for _, path in segments_of(folder, table):
            size = 0
            for end, numbers in batch_ends(path, TABLES[table]):
                if numbers.start < rows:
                    size, seen = end, max(seen, numbers.stop)
            if size:
                os.truncate(path, size)
            else:
                path.unlink()
    except OSError as error:
        raise storage_error(folder / SEGMENTS, error) from None
    if seen != rows:
        raise RunFolderError(
            f"{folder / SEGMENTS}: {table}: row {rows} must begin a batch, got {seen}"
        )
