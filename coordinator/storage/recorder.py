"""Table rows to disk: segments while a run lives, Parquet when it is done.

Rows are a function of the journal: a replay hands in the same rows again in the
same order, and those that already stand on disk are passed over by their number.
"""

import contextlib
from pathlib import Path

from coordinator.islands.events import Append, Record
from coordinator.storage.disk import storage_error
from coordinator.storage.folder import RunDetails
from coordinator.storage.table_file import TableFile
from schema.tables.columns import TABLES
from schema.tables.files import SEGMENTS, parquet_path, segments_of

WAITING = 64
"""Rows of one table that wait for each other before they are written."""


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
            name: TableFile(folder, name, paths[name], fsync=fsync) for name in TABLES
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

    def store(self, rows: Append) -> None:
        """Bring bulk rows to disk before the journal has what they belong to.

        Rows that a process before this one stored, and died before its journal
        told of them, are cut off.

        Raises:
            MalformedMessage: the columns are none of this table.
            RunFolderError: the disk is full or failed.
        """
        self._tables[rows.table].store(rows.rows, rows.columns)

    def append(self, rows: Append) -> None:
        """Take bulk rows that the journal has; those stored before just count.

        Raises:
            MalformedMessage: the columns are none of this table.
            RunFolderError: they are not on disk and do not come again, or the disk
                is full or failed.
        """
        self._tables[rows.table].take_columns(rows.rows, rows.columns)

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
