"""Writing of a table's segment and of the checksums beside it."""

import os
from pathlib import Path

import pyarrow as pa

from coordinator.storage.disk import AppendedFile, storage_errors
from schema.errors import RunFolderError
from schema.tables.checksums import MAGIC, sums_path, sums_record, sums_size
from schema.tables.segments import Batch


class Segment:
    """A new segment of a table, open for appending."""

    def __init__(self, path: Path, schema: pa.Schema, *, fsync: bool = False) -> None:
        """Create the files of a segment, with its schema.

        Args:
            path: of the segment; neither it nor its checksums exist.
            schema: of its rows.
            fsync: survive power loss, too.

        Raises:
            RunFolderError: the disk is full or failed.
        """
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
        """Append a batch, all or nothing.

        Raises:
            RunFolderError: the disk is full or failed.
        """
        self._append(batch.serialize())

    def _append(self, message: pa.Buffer) -> None:
        data = memoryview(message)
        self._file.append(data)
        try:
            self._sums.append(sums_record(self._file.size, data))
        except RunFolderError:
            self._file.cut(self._file.size - len(data))
            raise

    def close(self) -> None:
        """Close both files."""
        self._file.close()
        self._sums.close()


def cut_segment(path: Path, last: Batch | None) -> None:
    """Cut a segment behind a batch; remove it if there is none.

    Args:
        path: the segment; a segment of an earlier version has no checksums.
        last: batch that stays, with all before it.

    Raises:
        RunFolderError: the disk failed.
    """
    sums = sums_path(path)
    with storage_errors(path):
        if last is None:
            remove_segment(path)
            return
        # In this order, a cut in between leaves no record without its message.
        for file, size in ((sums, sums_size(last.messages)), (path, last.end)):
            if file.exists() and file.stat().st_size > size:
                os.truncate(file, size)


def remove_segment(path: Path) -> None:
    """Remove a segment and its checksums.

    Raises:
        RunFolderError: the disk failed.
    """
    sums = sums_path(path)
    with storage_errors(path):
        # First the records: one without its message would be damage after a kill.
        if sums.exists() and sums.stat().st_size > sums_size(0):
            os.truncate(sums, sums_size(0))
        for file in (path, sums):
            if file.exists():
                file.unlink()
