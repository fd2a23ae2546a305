"""One table of a run on disk: Arrow segments while it runs, Parquet at its end."""

import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.parquet

from coordinator.storage.disk import AppendedFile, replace_durably, storage_errors
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
    """Writer of one table.

    A table gets either single rows, which are buffered, or bulk rows as columns.

    Attributes:
        buffered: rows that are not on disk yet.
    """

    def __init__(self, folder: Path, name: str, parquet: Path, *, fsync: bool) -> None:
        self._folder = folder
        self._name = name
        self._parquet = parquet
        self._fsync = fsync
        self._schema = TABLES[name]
        self._segment: AppendedFile | None = None
        self._seen = 0
        self._ahead = 0
        self.buffered: list[Mapping[str, Any]] = []
        if parquet.exists():
            self._stored: int = read_table(folder, name).num_rows
            return
        self._stored, unused = stored_rows(folder, name)
        with storage_errors(folder):
            for _, path in unused:
                path.unlink()

    def take(self, row: Mapping[str, Any]) -> None:
        """Add the next row, unless it is already on disk."""
        if self._seen >= self._stored:
            self.buffered.append(row)
        self._seen += 1

    def store(self, rows: int, columns: bytes) -> None:
        """Write bulk rows ahead of the count; remove rows on disk that do not count."""
        known = self._seen + self._ahead
        if self._stored > known:
            _remove_rows(self._folder, self._name, known)
            self._stored = known
        if rows:
            self._write(self._bulk(rows, columns))
            self._ahead += rows

    def take_columns(self, rows: int, columns: bytes) -> None:
        """Count the next bulk rows; write them unless they are already on disk."""
        end = self._seen + rows
        if self._stored < end:
            if not columns:
                raise RunFolderError(
                    f"{self._folder / SEGMENTS}: {self._name}: rows {self._stored} to "
                    f"{end - 1} are missing, and the journal does not hold them: "
                    "restore a sound copy of the segments"
                )
            self.store(rows, columns)
        self._seen = end
        self._ahead = max(0, self._ahead - rows)

    def flush(self) -> None:
        """Write the buffered rows as one batch, all or none."""
        if self.buffered:
            self._write(self._batch())
            self.buffered = []

    def finish(self) -> None:
        """Write all rows as Parquet, unless the file exists."""
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
        """Write all rows, one row group in memory at a time."""
        with pa.parquet.ParquetWriter(path, self._schema, compression="zstd") as file:
            rows = self._schema.empty_table()
            for batch in batches_by_island(self._folder, self._name):
                rows = pa.concat_tables([rows, pa.Table.from_batches([batch])])
                while rows.num_rows >= ROW_GROUP:
                    file.write_table(rows.slice(0, ROW_GROUP))
                    rows = rows.slice(ROW_GROUP)
            if rows.num_rows:
                file.write_table(rows)

    def _write(self, batch: pa.RecordBatch) -> None:
        """Append a batch to the segment, all or nothing."""
        if self._parquet.exists():
            raise RunFolderError(
                f"{self._parquet}: finished with {self._stored} rows, got more"
            )
        if self._segment is None:
            self._segment = self._opened()
        self._segment.append(batch.serialize().to_pybytes())
        self._stored += batch.num_rows

    def _bulk(self, rows: int, columns: bytes) -> pa.RecordBatch:
        """Return bulk rows as one batch with record numbers."""
        table = read_columns(self._name, columns)
        if table.num_rows != rows:
            raise MalformedMessage(
                f"{self._name}: must be {rows} rows, got {table.num_rows}"
            )
        numbers = pa.array(range(self._stored, self._stored + rows), pa.int64())
        arrays = [numbers, *(column.combine_chunks() for column in table.columns)]
        return pa.RecordBatch.from_arrays(arrays, schema=self._schema)

    def _opened(self) -> AppendedFile:
        """Return a new segment that contains the schema."""
        numbers = [number for number, _ in segments_of(self._folder, self._name)]
        number = max(numbers, default=-1) + 1
        path = segment_path(self._folder, self._name, number)
        segment = AppendedFile(path, fsync=self._fsync)
        segment.append(self._schema.serialize().to_pybytes())
        return segment

    def _batch(self) -> pa.RecordBatch:
        """Return the buffered rows as one batch with record numbers."""
        rows = self.buffered
        first, *others = self._schema
        arrays = [
            pa.array(range(self._stored, self._stored + len(rows)), first.type),
            *(pa.array([row[each.name] for row in rows], each.type) for each in others),
        ]
        return pa.RecordBatch.from_arrays(arrays, schema=self._schema)


def _remove_rows(folder: Path, table: str, rows: int) -> None:
    """Remove all rows of a table from a number on, which must start a batch.

    Raises:
        RunFolderError: it does not start a batch, or the disk fails.
    """
    seen = 0
    with storage_errors(folder / SEGMENTS):
        for _, path in segments_of(folder, table):
            size = 0
            for end, numbers in batch_ends(path, TABLES[table]):
                if numbers.start < rows:
                    size, seen = end, max(seen, numbers.stop)
            if size:
                os.truncate(path, size)
            else:
                path.unlink()
    if seen != rows:
        raise RunFolderError(
            f"{folder / SEGMENTS}: {table}: row {rows} must start a batch, got {seen}"
        )
