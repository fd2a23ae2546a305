"""Writer of all tables of a run: Arrow segments while it runs, Parquet at its end.

Rows are a function of the journal. A replay passes the same rows in the same order, and
those that are already on disk are skipped by their number.
"""

import contextlib
from collections.abc import Callable, Mapping
from pathlib import Path

from coordinator.islands.events import Append, Record
from coordinator.storage.disk import storage_errors
from coordinator.storage.folder import RunDetails
from coordinator.storage.segment import remove_segment
from coordinator.storage.table_file import TableFile
from schema.tables.columns import TABLES
from schema.tables.files import parquet_path
from schema.tables.segments import SEGMENTS, segments_of

BUFFERED = 64
"""Rows of a table that are buffered before they are written together."""


class Recorder:
    """Writer of a run's tables; rows arrive in their repeatable order."""

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

        Args:
            folder: run folder.
            details: description of the run; names the Parquet files.
            fsync: survive power loss, too.
            seal: stores the SHA-256 of finished tables before they get their names.

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

    def write(self, record: Record) -> None:
        """Add one row; it may be buffered before it is written to disk.

        Args:
            record: ``row`` has every column of the table except ``record``.

        Raises:
            RunFolderError: the disk is full or failed; the row stays buffered.
        """
        table = self._tables[record.table]
        table.take(record.row)
        if len(table.buffered) >= BUFFERED:
            table.flush()

    def store(self, rows: Append) -> None:
        """Write bulk rows to disk before the journal gets the event they belong to.

        Rows that an earlier process stored without their event in the journal are
        removed first.

        Raises:
            MalformedMessage: the columns are not those of the table.
            RunFolderError: the disk is full or failed.
        """
        self._tables[rows.table].store(rows.rows, rows.columns)

    def append(self, rows: Append) -> None:
        """Add bulk rows whose event is in the journal; stored rows are only counted.

        Raises:
            MalformedMessage: the columns are not those of the table.
            RunFolderError: rows are missing on disk and the journal does not hold
                them, or the disk is full or failed.
        """
        self._tables[rows.table].take_columns(rows.rows, rows.columns)

    def stored(self, table: str) -> int:
        """Return how many rows of a table are on disk."""
        return self._tables[table].stored

    def keep(self, table: str, rows: int) -> None:
        """Remove the bulk rows on disk from a number on, which must start a batch.

        Raises:
            RunFolderError: it does not start a batch, or the disk failed.
        """
        self._tables[table].keep(rows)

    def restore(self, rows: Append) -> None:
        """Write bulk rows that are missing on disk, before a replay counts any.

        Raises:
            MalformedMessage: the columns are not those of the table.
            RunFolderError: the disk is full or failed.
        """
        self._tables[rows.table].restore(rows.rows, rows.columns)

    def flush(self) -> None:
        """Write all buffered rows to disk.

        Raises:
            RunFolderError: the disk is full or failed; no row is lost.
        """
        for table in self._tables.values():
            table.flush()

    def finish(self) -> None:
        """Convert all segments to Parquet, then remove them.

        After a kill at any point, each table is complete in one of the two forms: open
        the run again, replay, and finish again.

        Raises:
            RunFolderError: the disk is full or failed; the segments are intact.
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
