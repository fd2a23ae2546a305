"""Rewriting of a run folder, all or nothing at any kill, and removal of rows.

The new description, journal and poses are made in a folder beside the old ones. That
folder gets its final name when it is complete; from then on its files replace the old
ones, at once or when the run is opened again. A replay writes the other rows.
"""

import os
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from coordinator.storage.disk import storage_errors
from coordinator.storage.journal import NAME as JOURNAL
from schema.errors import RunFolderError
from schema.formats.files import BEST
from schema.tables.checksums import sums_path, sums_size
from schema.tables.description import DETAILS, STATE
from schema.tables.replacement import sync_file, sync_folder
from schema.tables.segments import FINISHED, SEGMENTS, Batch, read_segment, segments_of

COMPLETE = "rewritten"
_BEGUN = ".rewritten.new"


@contextmanager
def rewriting(folder: Path) -> Iterator[Path]:
    """Yield an empty folder for description, journal and segments of a locked run.

    At the end of the block they replace those of the run, which then has no finished
    tables, no other segments and no best robot. After an error nothing has changed.
    """
    place = folder / _BEGUN
    with storage_errors(place):
        _remove(place)
        place.mkdir()
    try:
        yield place
        with storage_errors(place):
            for file in filter(Path.is_file, place.rglob("*")):
                sync_file(file)
            place.rename(folder / COMPLETE)
            sync_folder(folder)
    except BaseException:
        _remove(place)
        raise
    complete_rewriting(folder)


def is_rewritten(folder: Path) -> bool:
    """Return whether files of a run are still to be replaced by complete new ones."""
    return (folder / COMPLETE).is_dir()


def complete_rewriting(folder: Path) -> None:
    """Replace the files of a locked run if complete new ones are there."""
    place = folder / COMPLETE
    with storage_errors(folder):
        _remove(folder / _BEGUN)
        if not is_rewritten(folder):
            return
        if (place / SEGMENTS).is_dir():
            _remove(folder / FINISHED)
            _remove(folder / SEGMENTS)
            (place / SEGMENTS).rename(folder / SEGMENTS)
        for name in (STATE, BEST):
            (folder / name).unlink(missing_ok=True)
        # The description last: without the others it would be that of another run.
        for name in (JOURNAL, DETAILS):
            if (place / name).exists():
                Path(place / name).replace(folder / name)
        place.rmdir()
        sync_folder(folder)


def _remove(folder: Path) -> None:
    if folder.exists():
        shutil.rmtree(folder)


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
