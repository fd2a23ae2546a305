"""Paths and reading of the tables of a run.

While a run is active, a table consists of Arrow stream segments, one per start of
its coordinator: ``segments/births-000.arrows``. A finished run has Parquet instead:
``tables/experiment=NAME/run=N/births.parquet``. The folder names hold columns (hive
partitioning), so that one call reads a campaign, such as DuckDB's
``read_parquet('runs/**/births.parquet', hive_partitioning = true)``. A segment of
another version raises ``RunFolderError``.
"""

from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import NamedTuple
from urllib.parse import quote

import pyarrow as pa
import pyarrow.compute as pc
from pyarrow.parquet import ParquetFile

from schema.errors import RunFolderError
from schema.robot.ids import BirthId
from schema.tables.checksums import digest_of, read_digests
from schema.tables.columns import TABLES, completed
from schema.tables.description import (
    check_folder,
    groups_of,
    read_description,
    run_columns,
)
from schema.tables.segments import (
    FINISHED,
    Batch,
    parquet_files,
    read_segment,
    segments_of,
    warn_once,
)

SORTED_BYTES = 32 * 2**20
"""Size of the rows of several islands that are sorted in memory together, about."""
GROUP_BYTES = 4 * 2**20
"""Size of the rows that are written, or read and filtered, at once, about."""


class Stored(NamedTuple):
    """Rows of a table's segments.

    Attributes:
        rows: their number before the first gap.
        used: segments before the gap, each with its last sound batch, None without one.
    """

    rows: int
    used: dict[Path, Batch | None]
    unused: list[Path]


def born_as(birth: BirthId) -> pc.Expression:
    """Return the filter for the rows of an individual, by island and number of birth.

    Tables that have a column ``birth_island`` may also have rows of immigrants with
    these numbers.
    """
    return (pc.field("island") == birth.island) & (pc.field("birth") == birth.number)


def parquet_path(folder: Path, experiment: str, run: int, table: str) -> Path:
    """Return a table's path in a finished run; the experiment is percent-encoded."""
    place = folder / FINISHED / f"experiment={quote(experiment, safe='')}"
    return place / f"run={run}" / f"{table}.parquet"


def stored_batches(folder: Path, table: str) -> Iterator[pa.RecordBatch]:
    """Yield the rows of a table's segments up to the first gap.

    Record numbers show gaps. A replay of the journal writes the rows behind a gap
    again. Only one batch is in memory at a time.
    """
    for _, batch, new in _chain(folder, table):
        if new:
            yield batch.rows.slice(batch.rows.num_rows - new)


def batches_by_island(folder: Path, table: str) -> Iterator[pa.RecordBatch]:
    """Yield these rows sorted by island, with new record numbers.

    Rows of about ``SORTED_BYTES``, or one batch, are in memory at a time. No batch is
    empty.
    """
    counts: Counter[int] = Counter()
    size = 0
    if "island" in TABLES[table].names:
        for batch in stored_batches(folder, table):
            size += batch.nbytes
            for each in pc.value_counts(batch["island"]).to_pylist():
                counts[each["values"]] += each["counts"]
    if len(counts) <= 1:
        yield from filter(len, stored_batches(folder, table))
        return
    rows = 0
    for islands in _read_together(counts, SORTED_BYTES * counts.total() // size):
        for own in _of_islands(folder, table, islands):
            numbers = pa.array(range(rows, rows + own.num_rows), pa.int64())
            rows += own.num_rows
            columns = [numbers, *own.columns[1:]]
            yield pa.RecordBatch.from_arrays(columns, schema=TABLES[table])


def _read_together(counts: Mapping[int, int], most: int) -> Iterator[list[int]]:
    """Yield all islands in order; groups of several have at most ``most`` rows."""
    group: list[int] = []
    rows = 0
    for island in sorted(counts):
        if group and rows + counts[island] > most:
            yield group
            group, rows = [], 0
        group.append(island)
        rows += counts[island]
    yield group


def _of_islands(
    folder: Path, table: str, islands: list[int]
) -> Iterator[pa.RecordBatch]:
    """Yield the rows of some islands, sorted by island; no batch is empty."""
    wanted = pa.array(islands, TABLES[table].field("island").type)
    parts = (
        batch.filter(pc.is_in(batch["island"], wanted))
        for batch in stored_batches(folder, table)
    )
    own = filter(len, parts)
    if len(islands) == 1:
        yield from own
        return
    rows = pa.Table.from_batches(own, TABLES[table]).combine_chunks()
    # The sort is stable: rows of an island keep their order.
    yield from rows.take(pc.sort_indices(rows["island"])).to_batches()


def in_groups(batches: Iterable[pa.RecordBatch]) -> Iterator[pa.Table]:
    """Yield rows in tables of about ``GROUP_BYTES``, or of one larger batch.

    Each column is in one piece: many small ones take long to write.
    """
    waiting: list[pa.RecordBatch] = []
    size = 0
    for batch in batches:
        waiting.append(batch)
        size += batch.nbytes
        if size >= GROUP_BYTES:
            yield pa.Table.from_batches(waiting).combine_chunks()
            waiting, size = [], 0
    if waiting:
        yield pa.Table.from_batches(waiting).combine_chunks()


def stored_rows(folder: Path, table: str) -> Stored:
    """Return which rows the segments of a table hold."""
    rows = 0
    paths = [path for _, path in segments_of(folder, table)]
    used: dict[Path, Batch | None] = dict.fromkeys(paths)
    for path, batch, new in _chain(folder, table):
        if new is None:
            place = paths.index(path)
            return Stored(rows, {p: used[p] for p in paths[:place]}, paths[place:])
        used[path] = batch
        rows += new
    return Stored(rows, used, [])


def _chain(folder: Path, table: str) -> Iterator[tuple[Path, Batch, int | None]]:
    """Yield (segment, batch, number of its rows that are new); None at a gap, the end.

    Duplicate rows count once: a coordinator that was suspended while another took over
    the run may finish a write. Both copies are equal.
    """
    rows = 0
    for _, path in segments_of(folder, table):
        for batch in read_segment(folder, table, path):
            numbers = batch.numbers
            if numbers.start > rows:
                warn_once(
                    f"{path}: rows {rows} to {numbers.start - 1} of {table} are lost; "
                    "those from there on are left out: to compute them again, resume "
                    "the run"
                )
                yield path, batch, None
                return
            new = max(0, numbers.stop - rows)
            rows += new
            yield path, batch, new


def has_rows(folder: Path, table: str) -> bool:
    """Return whether a run, or one of its groups, has any file of a table."""
    if groups := groups_of(folder):
        return any(has_rows(each, table) for each in groups)
    return bool(parquet_files(folder, table) or segments_of(folder, table))


def is_sealed(folder: Path) -> bool:
    """Return whether a run has once had finished tables.

    They get their digests together before the run's state becomes "finished". Runs of
    0.1 have no digests, but files. Groups are sealed if all are. Errors are those of
    ``read_description``.
    """
    if groups := groups_of(folder):
        return all(map(is_sealed, groups))
    description = read_description(folder)
    if description.checksums:
        return bool(description.digests)
    is_converted = any((folder / FINISHED).glob("*/*/*.parquet"))
    return is_converted or not segments_of(folder, "births")


def finished_path(folder: Path, table: str) -> Path | None:
    """Return the Parquet file of a table, compared with its digest; None without one.

    Raises:
        RunFolderError: it is damaged, or lost and no segment is in its place.
    """
    if why := damage_of(folder, table):
        raise RunFolderError(why)
    return next(iter(parquet_files(folder, table)), None)


def damage_of(folder: Path, table: str) -> str:
    """Return what is wrong with the Parquet file of a table; empty if nothing is.

    A file of 0.1 has no digest; it must be a Parquet file.
    """
    digest = read_digests(folder).get(table)
    found = parquet_files(folder, table)
    if not found:
        if not digest or segments_of(folder, table):
            return ""
        lost = folder / FINISHED / f"{table}.parquet"
        return f"{lost}: is lost: resume the run to write it again"
    why = ""
    try:
        if digest is None:
            warn_once(
                "runs of 0.1 have no digests: damage in tables may stay unnoticed"
            )
            ParquetFile(found[0]).close()
        elif digest_of(found[0]) != digest:
            why = "damaged (its SHA-256 is not the one in run.json)"
    except (ValueError, OSError) as error:
        why = f"cannot be read: {error}"
    return f"{found[0]}: {why}: resume the run to write it again" if why else ""


def read_table(
    folder: Path,
    table: str,
    columns: Sequence[str] | None = None,
    where: pc.Expression | None = None,
) -> pa.Table:
    """Return rows of a table of a run, finished or not, island by island.

    Rows of each island are in a repeatable order. Beside the result, about
    ``GROUP_BYTES`` are in memory. The condition ``where`` is on the columns that are
    read, all by default.

    Raises:
        RunFolderError: no such folder, a file that is damaged or cannot be read, or one
            of another version.
    """
    check_folder(folder)
    if groups := groups_of(folder):
        return joined(groups, table, columns, where)
    schema = TABLES[table]
    if columns is not None:
        schema = pa.schema(map(schema.field, columns), schema.metadata)
    path = finished_path(folder, table)
    if path is None:
        rows = _kept(in_groups(batches_by_island(folder, table)), schema, where)
        # A run that ends meanwhile removes its segments.
        path = finished_path(folder, table)
        if path is None:
            return rows
    return _kept(_finished(folder, path, schema), schema, where)


def joined(
    groups: Sequence[Path],
    table: str,
    columns: Sequence[str] | None = None,
    where: pc.Expression | None = None,
) -> pa.Table:
    """Return rows of all groups of an archipelago, as ``read_table`` does of a run.

    The one row of ``runs`` is that of the first group, from the first start to the
    last end.
    """
    wanted = TABLES[table].names if columns is None else columns
    ordered = {"island", "start", "end"} & {*TABLES[table].names}
    read = [*wanted, *(ordered - {*wanted})]
    rows = pa.concat_tables(read_table(each, table, read, where) for each in groups)
    if table == "runs":
        times = {"start": pc.min(rows["start"]), "end": pc.max(rows["end"])}
        rows = rows.slice(0, 1)
        for name, value in times.items():
            rows = with_column(rows, name, pa.repeat(value, 1))
    else:
        # The sort is stable: rows of an island keep their order.
        rows = rows.take(pc.sort_indices(rows["island"]))
    if "record" in wanted:
        rows = with_column(rows, "record", pa.array(range(len(rows)), pa.int64()))
    return rows.select(list(wanted))


def with_column(rows: pa.Table, name: str, values: pa.Array) -> pa.Table:
    """Return rows with other values in one of their columns."""
    at = rows.schema.get_field_index(name)
    return rows.set_column(at, rows.schema.field(at), values)


def rows_of_island(folder: Path, table: str, island: int) -> Iterator[pa.Table]:
    """Yield all rows of an island in their repeatable order, no group empty.

    Rows of a run that is not finished end at the first gap. About ``GROUP_BYTES`` are
    in memory at a time. Errors are those of ``read_table``.
    """
    if groups := groups_of(folder):
        folder = groups[island % len(groups)]
    path = finished_path(folder, table)
    parts = (
        in_groups(batches_by_island(folder, table))
        if path is None
        else _finished(folder, path, TABLES[table])
    )
    own = (part.filter(pc.field("island") == island) for part in parts)
    yield from filter(len, own)


def _finished(folder: Path, path: Path, schema: pa.Schema) -> Iterator[pa.Table]:
    """Yield the columns of a schema from a Parquet file; errors of ``read_table``."""
    of_run = run_columns(folder)
    try:
        with ParquetFile(path, page_checksum_verification=True) as file:
            stored = [each for each in schema.names if each in file.schema_arrow.names]
            for number in range(file.num_row_groups):
                # More threads would keep memory of their own.
                group = file.read_row_group(number, stored, use_threads=False)
                yield completed(group, schema, of_run)
    except (ValueError, OSError) as error:
        raise RunFolderError(f"{path}: cannot be read: {error}") from None


def _kept(
    groups: Iterable[pa.Table], schema: pa.Schema, where: pc.Expression | None
) -> pa.Table:
    """Return some columns of the rows that meet a condition on them."""
    rows = (group.select(schema.names) for group in groups)
    kept = rows if where is None else (group.filter(where) for group in rows)
    return pa.concat_tables([schema.empty_table(), *kept])
