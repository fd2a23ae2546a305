"""Writer of all tables of a run: Arrow segments while it runs, Parquet at its end.

Rows are a function of the journal. A replay passes the same rows in the same order, and
those that are already on disk are skipped by their number.
"""

import contextlib
from pathlib import Path

from coordinator.islands.events import Append, Record
from coordinator.storage.disk import storage_errors
from coordinator.storage.folder import RunDetails
from coordinator.storage.table_file import TableFile
from schema.tables.columns import TABLES
from schema.tables.files import SEGMENTS, parquet_path, segments_of

BUFFERED = 64
"""Rows of a table that are buffered before they are written together."""


class Recorder:
    """Writer of a run's tables; rows arrive in their repeatable order."""

    def __init__(
        self, folder: Path, details: RunDetails, *, fsync: bool = False
    ) -> None:
        """Open the tables of a run folder that this process has locked.

        Args:
            folder: run folder.
            details: description of the run; names the Parquet files.
            fsync: survive power loss, too.

        Raises:
            RunFolderError: a segment has another version, or the disk fails.
        """
        self._folder = folder
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
        for table in self._tables.values():
            table.finish()
        self.close()
        with storage_errors(self._folder / SEGMENTS):
            for name in TABLES:
                for _, path in segments_of(self._folder, name):
                    path.unlink()
        # Fails if the folder holds foreign files; they stay.
        with contextlib.suppress(OSError):
            (self._folder / SEGMENTS).rmdir()

    def close(self) -> None:
        """Close all files; buffered rows are dropped, a replay adds them again."""
        for table in self._tables.values():
            table.close()
