"""Tables through kills at any byte and any step, and on full disks."""

import os
import resource
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import duckdb
import numpy as np
import polars as pl
import pyarrow as pa
import pytest

from coordinator.events import Record
from coordinator.folder import RunDetails
from coordinator.record import WAITING, Recorder
from schema.errors import RunFolderError
from schema.run_tables import (
    campaign,
    parquet_path,
    read_segment,
    read_table,
    segment_path,
    segments_of,
)
from schema.tables import BIRTHS, POPULATION, TABLES

DETAILS = RunDetails("a/b c", 2, 1, "{}")
Make = Callable[..., list[Record]]


def feed(folder: Path, rows: list[Record], every: int = 10) -> Recorder:
    """Return a recorder that took rows and flushed after every few."""
    recorder = Recorder(folder, DETAILS)
    for index, record in enumerate(rows, start=1):
        recorder.write(record)
        if index % every == 0:
            recorder.flush()
    return recorder


def expected(rows: list[Record], table: str) -> pa.Table:
    """Return what a table must hold."""
    own = [record.row for record in rows if record.table == table]
    numbered = [{"record": index, **row} for index, row in enumerate(own)]
    return pa.Table.from_pylist(numbered, TABLES[table])


def assert_complete(folder: Path, rows: list[Record]) -> None:
    """Fail unless every table holds exactly these rows."""
    for name in TABLES:
        found = read_table(folder, name)
        assert found.equals(expected(rows, name), check_metadata=True), name


@contextmanager
def no_file_beyond(size: int) -> Iterator[None]:
    """Let no file of this process grow beyond a size, as a full disk would not."""
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, hard))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))


def test_rows_come_back_before_and_after_the_end(
    tmp_path: Path, make_records: Make
) -> None:
    rows = make_records(20)
    recorder = feed(tmp_path, rows)
    recorder.flush()
    assert_complete(tmp_path, rows)
    recorder.finish()
    assert_complete(tmp_path, rows)
    files = [path for path in tmp_path.rglob("*") if path.is_file()]
    assert sorted(files) == sorted(
        parquet_path(tmp_path, "a/b c", 2, name) for name in TABLES
    )


def test_enough_rows_are_on_disk_without_a_flush(
    tmp_path: Path, make_records: Make
) -> None:
    recorder = Recorder(tmp_path, DETAILS)
    births = [record for record in make_records(WAITING) if record.table == "births"]
    for record in births[:-1]:
        recorder.write(record)
    assert read_table(tmp_path, "births").num_rows == 0
    recorder.write(births[-1])
    assert read_table(tmp_path, "births").num_rows == WAITING
    recorder.close()


@pytest.mark.parametrize("seed", range(5))
def test_many_incarnations_write_what_one_does(
    tmp_path: Path, make_records: Make, seed: int
) -> None:
    rng = np.random.default_rng(seed)
    rows = make_records(30)
    for stop in sorted(rng.integers(0, len(rows), 5)):
        # Each is killed after some rows: what waits is lost.
        feed(tmp_path, rows[:stop], every=int(rng.integers(1, 20))).close()
    recorder = feed(tmp_path, rows)
    recorder.finish()
    assert_complete(tmp_path, rows)


def test_a_segment_cut_at_any_byte_gives_exactly_its_whole_batches(
    tmp_path: Path, make_records: Make
) -> None:
    rows = [record for record in make_records(4) if record.table == "births"]
    recorder = Recorder(tmp_path, DETAILS)
    path = segment_path(tmp_path, "births", 0)
    ends = []
    for record in rows:
        recorder.write(record)
        recorder.flush()
        ends.append(path.stat().st_size)
    recorder.close()
    data = path.read_bytes()
    whole = pa.Table.from_batches(read_segment(path, BIRTHS))
    for cut in range(len(data)):
        path.write_bytes(data[:cut])
        batches = read_segment(path, BIRTHS)
        assert len(batches) == sum(end <= cut for end in ends)
        kept = pa.Table.from_batches(batches, BIRTHS)
        assert kept.equals(whole.slice(0, len(batches)))


def test_a_run_resumes_from_a_segment_cut_anywhere(
    tmp_path: Path, make_records: Make
) -> None:
    rows = make_records(9)
    first = tmp_path / "first"
    first.mkdir()
    feed(first, rows[:15], every=4).close()
    data = segment_path(first, "births", 0).read_bytes()
    rng = np.random.default_rng(7)
    for cut in [0, 1, len(data), *rng.integers(0, len(data), 25)]:
        folder = tmp_path / f"run-{cut}"
        (folder / "segments").mkdir(parents=True)
        segment_path(folder, "births", 0).write_bytes(data[:cut])
        recorder = feed(folder, rows)
        recorder.flush()
        assert_complete(folder, rows)
        recorder.finish()
        assert_complete(folder, rows)


def test_rows_behind_a_damaged_segment_are_written_again(
    tmp_path: Path, make_records: Make
) -> None:
    rows = make_records(20)
    feed(tmp_path, rows[:20], every=5).close()
    feed(tmp_path, rows[:40], every=5).close()
    path = segment_path(tmp_path, "births", 0)
    os.truncate(path, path.stat().st_size // 2)
    kept = read_table(tmp_path, "births").num_rows
    assert 0 < kept < 8
    recorder = feed(tmp_path, rows)
    recorder.flush()
    assert_complete(tmp_path, rows)
    # The number of the segment that was of no use is free again.
    assert [number for number, _ in segments_of(tmp_path, "births")] == [0, 1]
    recorder.finish()
    assert_complete(tmp_path, rows)


class Killed(BaseException):
    """The process dies here."""


def kill_at(monkeypatch: pytest.MonkeyPatch, step: int) -> list[str]:
    """Make the ``step``-th change to the disk the last; return the steps' names."""
    steps: list[str] = []

    def dying(name: str, real: Callable[..., Any]) -> Callable[..., Any]:
        def call(*arguments: Any) -> Any:  # noqa: ANN401 - whatever the real one takes
            steps.append(name)
            if len(steps) > step:
                raise Killed
            return real(*arguments)

        return call

    monkeypatch.setattr(os, "fsync", dying("fsync", os.fsync))
    monkeypatch.setattr(Path, "replace", dying("replace", Path.replace))

    def unlink(path: Path, *, missing_ok: bool = False) -> None:
        del missing_ok
        steps.append("unlink")
        if len(steps) > step:
            raise Killed
        os.unlink(path)  # noqa: PTH108 - the real one is what stands in its place

    monkeypatch.setattr(Path, "unlink", unlink)
    monkeypatch.setattr(Path, "rmdir", dying("rmdir", Path.rmdir))
    return steps


def test_the_end_may_be_interrupted_at_any_step(
    tmp_path: Path, make_records: Make
) -> None:
    rows = make_records(8)
    interrupted = 0
    for step in range(100):
        folder = tmp_path / str(step)
        folder.mkdir()
        feed(folder, rows[:7]).close()
        recorder = feed(folder, rows)
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
        assert_complete(folder, rows)
        again = feed(folder, rows)
        again.finish()
        assert_complete(folder, rows)
        assert not (folder / "segments").exists()
        if is_done:
            break
    # Four tables to sync, rename and sync; at least four segments to remove.
    assert interrupted >= 4 * 3 + 4


def test_rows_after_the_end_are_refused(tmp_path: Path, make_records: Make) -> None:
    feed(tmp_path, make_records(5)).finish()
    recorder = feed(tmp_path, make_records(6), every=1000)
    with pytest.raises(RunFolderError, match="finished with 5 rows, and more came"):
        recorder.flush()


def test_a_full_disk_loses_no_row(tmp_path: Path, make_records: Make) -> None:
    rows = make_records(20)
    recorder = feed(tmp_path, rows[:20], every=20)
    size = segment_path(tmp_path, "births", 0).stat().st_size
    for record in rows[20:]:
        recorder.write(record)
    with no_file_beyond(size + 500), pytest.raises(RunFolderError, match="disk full"):
        recorder.flush()
    assert segment_path(tmp_path, "births", 0).stat().st_size == size
    recorder.flush()
    assert_complete(tmp_path, rows)
    with no_file_beyond(1000), pytest.raises(RunFolderError, match="disk full"):
        recorder.finish()
    assert_complete(tmp_path, rows)
    recorder.finish()
    assert_complete(tmp_path, rows)


def test_a_segment_of_another_version_is_refused(
    tmp_path: Path, make_records: Make
) -> None:
    feed(tmp_path, make_records(3)).close()
    path = segment_path(tmp_path, "population", 0)
    newer = POPULATION.with_metadata({"revolve.schema_version": "999"})
    path.write_bytes(newer.serialize().to_pybytes())
    with pytest.raises(RunFolderError, match="another version of Revolve"):
        Recorder(tmp_path, DETAILS)


def test_a_row_without_a_column_is_our_own_fault(
    tmp_path: Path, make_records: Make
) -> None:
    row = dict(make_records(1)[0].row)
    del row["rank"]
    recorder = Recorder(tmp_path, DETAILS)
    recorder.write(Record("births", row))
    with pytest.raises(KeyError, match="rank"):
        recorder.flush()
    recorder.close()


def test_one_call_reads_a_campaign(tmp_path: Path, make_records: Make) -> None:
    for run, count in enumerate((4, 7)):
        folder = tmp_path / "runs" / f"any-{run}"
        folder.mkdir(parents=True)
        recorder = Recorder(folder, RunDetails("a/b c", run, 1, "{}"))
        for record in make_records(count):
            recorder.write(record)
        recorder.finish()
    table = campaign(tmp_path / "runs", "births").to_table()
    counts = table.group_by(["experiment", "run"]).aggregate([("birth", "count")])
    assert sorted(tuple(row.values()) for row in counts.to_pylist()) == [
        ("a/b c", 0, 4),
        ("a/b c", 1, 7),
    ]
    assert table.schema.field("rank").metadata[b"repeatable"] == b"true"
    # The same files to the readers of others, bodies and all.
    files = str(tmp_path / "runs" / "**" / "births.parquet")
    frame = pl.read_parquet(files, hive_partitioning=True)
    assert frame.group_by("run").len().sort("run").rows() == [(0, 4), (1, 7)]
    relation = duckdb.read_parquet(files, hive_partitioning=True)
    bodies = relation.aggregate("run, sum(len(body))", "run").order("run")
    # Bodies of 1, 2, 3, 4, 1, 2, 3 parts.
    assert bodies.fetchall() == [(0, 10), (1, 16)]


def test_a_campaign_without_a_finished_run_is_an_error_in_words(
    tmp_path: Path,
) -> None:
    with pytest.raises(RunFolderError, match="no finished run"):
        campaign(tmp_path, "births")
    with pytest.raises(RunFolderError, match="no such folder"):
        read_table(tmp_path / "none", "births")
