"""Removal of rows from a table's segments, and of segments, with their checksums."""

import os
from pathlib import Path

from coordinator.storage.disk import storage_errors
from schema.errors import RunFolderError
from schema.tables.checksums import sums_path, sums_size
from schema.tables.segments import SEGMENTS, Batch, read_segment, segments_of


def remove_rows(folder: Path, table: str, rows: int) -> None:
    """Remove all rows of a table from a number on, which must start a batch."""
    seen = 0
    for _, path in segments_of(folder, table):
        kept = None
        for batch in read_segment(folder, table, path):
            if batch.numbers.start < rows:
                kept, seen = batch, max(seen, batch.numbers.stop)
        cut_segment(path, kept)
    if seen != rows:
        raise RunFolderError(
            f"{folder / SEGMENTS}: {table}: row {rows} must start a batch, got {seen}"
        )


def cut_segment(path: Path, last: Batch | None) -> None:
    """Cut a segment behind a batch; remove it if there is none."""
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
    """Remove a segment and its checksums."""
    sums = sums_path(path)
    with storage_errors(path):
        # First the records: one without its message would be damage after a kill.
        if sums.exists() and sums.stat().st_size > sums_size(0):
            os.truncate(sums, sums_size(0))
        for file in (path, sums):
            if file.exists():
                file.unlink()
