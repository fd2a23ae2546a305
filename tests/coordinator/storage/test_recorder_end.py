"""The end of a run: its tables, whatever interrupts it, in bounded memory."""

import os
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import duckdb
import polars as pl
import pyarrow as pa
import pyarrow.compute as pc
import pytest
from pyarrow.parquet import ParquetFile, ParquetWriter

from coordinator.storage.recorder import Recorder, Segment
from schema.errors import RunFolderError
from schema.tables import files
from schema.tables.columns import TABLES
from schema.tables.description import RunDetails
from schema.tables.files import parquet_path, read_table
from schema.tables.segments import SEGMENTS, segment_path
from tests.coordinator.records import birth_row, check_complete, feed_rows, make_records


class Killed(BaseException):
    """Simulated death of the process."""


def kill_at(monkeypatch: pytest.MonkeyPatch, step: int) -> None:
    """Die after the ``step``-th change of the disk."""
    done = 0

    def dying(real: Callable[..., Any]) -> Callable[..., Any]:
        def call(*arguments: Any, **options: Any) -> Any:  # noqa: ANN401 - those of the real one
            nonlocal done
            done += 1
            if done > step:
                raise Killed
            return real(*arguments, **options)

        return call

    monkeypatch.setattr(os, "fsync", dying(os.fsync))
    for name in ("replace", "unlink", "rmdir"):
        monkeypatch.setattr(Path, name, dying(getattr(Path, name)))


def test_the_end_may_be_interrupted_at_any_step(tmp_path: Path) -> None:
    rows = make_records(8)
    interrupted = 0
    for step in range(100):
        folder = tmp_path / str(step)
        folder.mkdir()
        feed_rows(folder, rows[:7]).close()
        recorder = feed_rows(folder, rows)
        with pytest.MonkeyPatch.context() as monkeypatch:
            kill_at(monkeypatch, step)
            try:
                recorder.finish()
            except Killed:
                interrupted += 1
                is_done = False
            else:
                is_done = True
        # Whoever reads now sees every row, and so does the next coordinator.
        check_complete(folder, rows)
        again = feed_rows(folder, rows)
        again.finish()
        check_complete(folder, rows)
        assert not (folder / "segments").exists()
        if is_done:
            break
    # Four tables to sync, rename and sync; at least four segments to remove.
    assert interrupted >= 4 * 3 + 4


@pytest.mark.parametrize("every", [1, 25, 1000])
def test_row_groups_are_small_and_written_in_one_piece(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, every: int
) -> None:
    """Columns in many chunks take time quadratic in their number."""
    chunks, sizes = [], []
    real = ParquetWriter.write_table

    def write(self: ParquetWriter, table: pa.Table) -> None:
        chunks.append(table["record"].num_chunks)
        sizes.append(table.num_rows)
        real(self, table)

    monkeypatch.setattr(ParquetWriter, "write_table", write)
    recorder = feed_rows(tmp_path, make_records(24), every=every)
    recorder.flush()
    rows = read_table(tmp_path, "births")
    monkeypatch.setattr(files, "GROUP_BYTES", rows.nbytes // 3)
    recorder.finish()
    assert read_table(tmp_path, "births").equals(rows)
    about = ParquetFile(parquet_path(tmp_path, "a/b c", 2, "births")).metadata
    found = [about.row_group(each).num_rows for each in range(about.num_row_groups)]
    births = sizes[: len(found)]
    assert found == births
    assert len(births) == (1 if every == 1000 else 3)
    assert set(chunks) == {1}


def test_rows_after_the_end_are_refused(tmp_path: Path) -> None:
    feed_rows(tmp_path, make_records(5)).finish()
    recorder = feed_rows(tmp_path, make_records(6), every=1000)
    with pytest.raises(RunFolderError, match="finished with 5 rows, got more"):
        recorder.flush()


def test_other_readers_read_all_runs_of_a_campaign(tmp_path: Path) -> None:
    for run, count in enumerate((4, 7)):
        folder = tmp_path / "runs" / f"any-{run}"
        folder.mkdir(parents=True)
        recorder = Recorder(folder, RunDetails("a/b c", run, 1, "{}"))
        for record in make_records(count):
            recorder.write(record)
        recorder.finish()
    # Bodies and all.
    files = str(tmp_path / "runs" / "**" / "births.parquet")
    frame = pl.read_parquet(files, hive_partitioning=True)
    assert frame.group_by("run").len().sort("run").rows() == [(0, 4), (1, 7)]
    relation = duckdb.read_parquet(files, hive_partitioning=True)
    bodies = relation.aggregate("run, sum(len(body))", "run").order("run")
    # Bodies of 1, 2, 3, 4, 1, 2, 3 parts.
    assert bodies.fetchall() == [(0, 10), (1, 16)]


def test_a_missing_folder_is_refused(tmp_path: Path) -> None:
    with pytest.raises(RunFolderError, match="no such folder"):
        read_table(tmp_path / "none", "births")


DETAILS = RunDetails("long", 0, 1, "{}")
BATCH, GENOME = 64, 4000
"""Rows of a batch, and bytes of each row."""
GROUP = 4 * BATCH * GENOME
SHORT, LONG = 16, 64
"""Batches of a run and of a longer one: 4 MB and 16 MB."""

POOLS: list[pa.MemoryPool] = []
"""Pools that were used: Arrow may free memory of theirs until the process ends."""


def run_of(folder: Path, batches: int, islands: int = 1) -> Path:
    """Write segments of births; islands take turns."""
    (folder / SEGMENTS).mkdir(parents=True)
    rows = [
        {**birth_row(4), "genome": bytes(GENOME), "island": number % islands}
        for number in range(BATCH)
    ]
    missing = {"record": 0, "seed": 1, "run_id": "0" * 12}
    schema = TABLES["births"]
    batch = pa.RecordBatch.from_pylist([{**missing, **row} for row in rows], schema)
    segment = Segment(segment_path(folder, "births", 0), schema)
    for number in range(batches):
        records = pa.array(range(number * BATCH, (number + 1) * BATCH), pa.int64())
        segment.append(batch.set_column(0, schema.field("record"), records))
    segment.close()
    return folder


def peak(action: Callable[[], object]) -> int:
    """Return the most memory that Arrow has for an action at a time [bytes]."""
    usual = pa.default_memory_pool()
    pool = pa.proxy_memory_pool(usual)
    POOLS.append(pool)
    pa.set_memory_pool(pool)
    try:
        action()
    finally:
        pa.set_memory_pool(usual)
    return int(pool.max_memory())


@pytest.fixture(autouse=True)
def _small_groups(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(files, "GROUP_BYTES", GROUP)
    monkeypatch.setattr(files, "SORTED_BYTES", GROUP)


@pytest.mark.parametrize("islands", [1, 8])
def test_tables_are_finished_in_the_same_memory_whatever_their_length(
    tmp_path: Path, islands: int
) -> None:
    peaks = []
    for batches in (SHORT, LONG):
        folder = run_of(tmp_path / str(batches), batches, islands)
        peaks.append(peak(Recorder(folder, DETAILS).finish))
        found = read_table(folder, "births", ["record", "island"])
        assert found["record"].to_pylist() == list(range(batches * BATCH))
        assert found["island"].to_pylist() == sorted(found["island"].to_pylist())
    assert peaks[0] > GROUP
    assert peaks[1] < 1.3 * peaks[0]


@pytest.mark.parametrize("is_finished", [True, False])
def test_a_column_or_a_row_is_read_in_the_same_memory_whatever_their_number(
    tmp_path: Path, *, is_finished: bool
) -> None:
    row = pc.field("record") == BATCH
    peaks = []
    for batches in (SHORT, LONG):
        folder = run_of(tmp_path / str(batches), batches)
        if is_finished:
            Recorder(folder, DETAILS).finish()
        whole = read_table(folder, "births")
        assert read_table(folder, "births", where=row).equals(whole.filter(row))
        some = read_table(folder, "births", ["birth", "record"])
        assert some.equals(whole.select(["birth", "record"]))
        one = read_table(folder, "births", ["genome", "record"], row)
        assert one.equals(whole.filter(row).select(["genome", "record"]))
        del whole
        peaks += [
            peak(partial(read_table, folder, "births", ["birth"])),
            peak(partial(read_table, folder, "births", where=row)),
        ]
    column = 8 * BATCH * (LONG - SHORT)
    assert peaks[2] < 1.3 * peaks[0] + column
    assert peaks[3] < 1.3 * peaks[1]
