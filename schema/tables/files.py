"""Paths and reading of the tables of a run.

While a run is active, a table consists of Arrow stream segments, one per start of
its coordinator: ``segments/births-000.arrows``. A finished run has Parquet instead:
``tables/experiment=NAME/run=N/births.parquet``. The folder names hold columns (hive
partitioning), so that one call reads a campaign, such as DuckDB's
``read_parquet('runs/**/births.parquet', hive_partitioning = true)``.
"""

import contextlib
from collections.abc import Iterator
from pathlib import Path
from urllib.parse import quote

import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.dataset
from pyarrow.parquet import ParquetFile

from schema.errors import RunFolderError
from schema.tables.columns import TABLES, completed, is_earlier

SEGMENTS = "segments"
FINISHED = "tables"


def parquet_path(folder: Path, experiment: str, run: int, table: str) -> Path:
    """Return the path of a table of a finished run.

    Args:
        folder: the run folder.
        experiment: its name, which is percent-encoded.
        run: number of the repeat.
        table: its name.
    """
    place = folder / FINISHED / f"experiment={quote(experiment, safe='')}"
    return place / f"run={run}" / f"{table}.parquet"


def segment_path(folder: Path, table: str, number: int) -> Path:
    """Return the path of a segment of a table."""
    return folder / SEGMENTS / f"{table}-{number:03d}.arrows"


def segments_of(folder: Path, table: str) -> list[tuple[int, Path]]:
    """Return number and path of each segment of a table, in order."""
    found = (folder / SEGMENTS).glob(f"{table}-*.arrows")
    return sorted((int(path.stem.removeprefix(f"{table}-")), path) for path in found)


def batch_ends(path: Path, schema: pa.Schema) -> list[tuple[int, range]]:
    """Return the end of each complete batch of a segment, and its record numbers.

    Raises:
        RunFolderError: the segment is of another version of its table, or the disk
            fails.
    """
    return [(end, _numbers(batch)) for end, batch in _batches(path, schema)]


def _numbers(batch: pa.RecordBatch) -> range:
    """Return the record numbers of a batch; they are consecutive."""
    first = batch["record"][0].as_py() if batch.num_rows else 0
    return range(first, first + batch.num_rows)


def _batches(path: Path, schema: pa.Schema) -> Iterator[tuple[int, pa.RecordBatch]]:
    """Yield the end of each complete batch of a segment, and the batch."""
    try:
        source = pa.OSFile(str(path))
    except OSError as error:
        raise RunFolderError(f"{path}: cannot be read: {error.strerror}") from None
    with source, contextlib.suppress(pa.ArrowInvalid, OSError, MemoryError):
        # A truncated or damaged tail raises one of these; the batches before are whole.
        reader = pa.ipc.open_stream(source)
        if not is_earlier(reader.schema, schema):
            raise RunFolderError(
                f"{path}: was written by another version of Revolve: finish the run "
                "with that version"
            )
        for batch in reader:
            yield source.tell(), _whole(batch, schema)


def _whole(batch: pa.RecordBatch, schema: pa.Schema) -> pa.RecordBatch:
    """Return a batch with all columns of its table."""
    if batch.schema.names == schema.names:
        return batch
    columns = completed(pa.Table.from_batches([batch]), schema).columns
    arrays = [column.combine_chunks() for column in columns]
    return pa.RecordBatch.from_arrays(arrays, schema=schema)


def stored_batches(folder: Path, table: str) -> Iterator[pa.RecordBatch]:
    """Yield the rows of a table's segments up to the first gap.

    Record numbers show gaps. A replay of the journal writes the rows behind a gap
    again. Only one batch is in memory at a time.

    Args:
        folder: the run folder.
        table: its name.

    Raises:
        RunFolderError: a segment of another version.
    """
    for _, batch in _chain(folder, table):
        if batch is not None:
            yield batch


def batches_by_island(folder: Path, table: str) -> Iterator[pa.RecordBatch]:
    """Yield these rows sorted by island, with new record numbers.

    Raises:
        RunFolderError: a segment of another version.
    """
    islands: set[int] = set()
    if "island" in TABLES[table].names:
        for batch in stored_batches(folder, table):
            islands.update(pc.unique(batch["island"]).to_pylist())
    if len(islands) <= 1:
        yield from stored_batches(folder, table)
        return
    rows = 0
    for island in sorted(islands):
        for batch in stored_batches(folder, table):
            own = batch.filter(pc.equal(batch["island"], island))
            numbers = pa.array(range(rows, rows + own.num_rows), pa.int64())
            rows += own.num_rows
            columns = [numbers, *own.columns[1:]]
            yield pa.RecordBatch.from_arrays(columns, schema=TABLES[table])


def stored_rows(folder: Path, table: str) -> tuple[int, list[tuple[int, Path]]]:
    """Return the number of rows before the first gap, and the unused segments.

    Raises:
        RunFolderError: a segment of another version.
    """
    rows, unused = 0, []
    for index, batch in _chain(folder, table):
        if batch is None:
            unused = segments_of(folder, table)[index:]
        else:
            rows += batch.num_rows
    return rows, unused


def _chain(folder: Path, table: str) -> Iterator[tuple[int, pa.RecordBatch | None]]:
    """Yield (index of the segment, batch); the batch is None at a gap.

    Duplicate rows are yielded once: a coordinator that was suspended while another
    took over the run may finish a write. Both copies are equal.
    """
    rows = 0
    for index, (_, path) in enumerate(segments_of(folder, table)):
        for _, batch in _batches(path, TABLES[table]):
            numbers = _numbers(batch)
            if numbers.start > rows:
                yield index, None
                return
            if new := max(0, numbers.stop - rows):
                rows += new
                yield index, batch.slice(batch.num_rows - new)


def has_rows(folder: Path, table: str) -> bool:
    """Return whether a run has any file of a table."""
    finished = (folder / FINISHED).glob(f"*/*/{table}.parquet")
    return any(finished) or bool(segments_of(folder, table))


def read_table(folder: Path, table: str) -> pa.Table:
    """Return all rows of a table of a run, finished or not, island by island.

    Rows of each island are in a repeatable order.

    Args:
        folder: the run folder.
        table: its name, a key of ``TABLES``.

    Raises:
        RunFolderError: no such folder, a file that cannot be read, or one of another
            version.
    """
    if not folder.is_dir():
        raise RunFolderError(f"{folder}: no such folder")
    finished = sorted((folder / FINISHED).glob(f"*/*/{table}.parquet"))
    if not finished:
        return pa.Table.from_batches(batches_by_island(folder, table), TABLES[table])
    try:
        return completed(ParquetFile(finished[0]).read(), TABLES[table])
    except (ValueError, OSError) as error:
        raise RunFolderError(f"{finished[0]}: cannot be read: {error}") from None


def campaign(root: Path, table: str) -> pa.dataset.Dataset:
    """Return one table of all finished runs below a folder.

    Args:
        root: a run folder, or a folder above several.
        table: its name, a key of ``TABLES``.

    Returns:
        A dataset with the table's columns, ``experiment`` and ``run``.

    Raises:
        RunFolderError: no finished run.
    """
    files = sorted(root.glob(f"**/{FINISHED}/*/*/{table}.parquet"))
    if not files:
        raise RunFolderError(f"{root}: no finished run in this folder or below")
    return pa.dataset.dataset([str(file) for file in files], partitioning="hive")
