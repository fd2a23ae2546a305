"""One run of the groups of islands of an archipelago, as one coordinator makes it."""

import shutil
from collections.abc import Iterator, Sequence
from pathlib import Path

import pyarrow as pa
from msgspec import structs

from coordinator.storage.disk import storage_errors
from coordinator.storage.hints import command
from coordinator.storage.recorder import write_parquet
from schema.errors import RunFolderError
from schema.experiment.document import island_count
from schema.experiment.file import experiment_from_text
from schema.experiment.identity import WHOLE
from schema.plugins.kept import PLUGINS
from schema.tables.checksums import digest_of
from schema.tables.columns import TABLES
from schema.tables.description import (
    DETAILS,
    STATE,
    check_groups,
    description_text,
    groups_of,
    make_folder,
    read_description,
    read_state,
)
from schema.tables.files import (
    has_rows,
    is_sealed,
    joined,
    parquet_path,
    rows_of_island,
    with_column,
)
from schema.tables.replacement import sync_file, sync_folder


def join_groups(given: Sequence[Path], out: Path) -> None:
    """Write the finished run of all groups to a new folder, all or nothing.

    It has no journal, so it cannot be lengthened; the groups can.

    ``given``: the folders of groups, or those that hold them.

    Raises:
        RunFolderError: a group is missing, doubled, of another archipelago or not
            finished, or has other births; the new folder is not empty; or a disk fails.
    """
    folders = [one for each in given for one in groups_of(each) or [each]]
    known = {each: read_description(each) for each in folders}
    groups = check_groups(known)
    for each in groups:
        if known[each].document != known[groups[0]].document:
            raise RunFolderError(
                f"{each}: must have as many births as {groups[0]}; to continue it: "
                f"{command('resume', each)} --births N"
            )
        if read_state(each) != "finished" or not is_sealed(each):
            raise RunFolderError(
                f"{each}: is not finished; to continue it: {command('resume', each)}"
            )
    make_folder(out.parent)
    if out.exists() and (not out.is_dir() or any(out.iterdir())):
        raise RunFolderError(f"{out}: not empty: choose another folder")
    place = out.with_name(f".{out.name}.new")
    with storage_errors(place):
        shutil.rmtree(place, ignore_errors=True)
        try:
            _write(groups, place)
            place.rename(out)
        finally:
            shutil.rmtree(place, ignore_errors=True)
        sync_folder(out.parent)


def _write(groups: Sequence[Path], place: Path) -> None:
    """Write tables, description, state and the plug-ins' copies to a folder."""
    known = read_description(groups[0])
    digests = {}
    for table in TABLES:
        if any(has_rows(each, table) for each in groups):
            path = parquet_path(place, known.name, known.run, table)
            path.parent.mkdir(parents=True, exist_ok=True)
            islands = island_count(experiment_from_text(known.document, is_own=True))
            write_parquet(path, table, _parts(groups, table, islands))
            digests[table] = digest_of(path)
    if (groups[0] / PLUGINS).is_dir():
        shutil.copytree(groups[0] / PLUGINS, place / PLUGINS)
    whole = structs.replace(known, group=WHOLE, digests=digests)
    (place / DETAILS).write_text(description_text(whole), encoding="utf-8")
    (place / STATE).write_text("finished", encoding="utf-8")
    for file in filter(Path.is_file, place.rglob("*")):
        sync_file(file)


def _parts(groups: Sequence[Path], table: str, islands: int) -> Iterator[pa.Table]:
    """Yield the rows of a table, island by island; few are in memory at a time."""
    if "island" not in TABLES[table].names:
        yield joined(groups, table)
        return
    rows = 0
    for island in range(islands):
        for part in rows_of_island(groups[island % len(groups)], table, island):
            numbers = pa.array(range(rows, rows + len(part)), pa.int64())
            rows += len(part)
            yield with_column(part, "record", numbers)
