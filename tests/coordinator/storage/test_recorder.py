"""Tables of an unfinished run: killed at any byte, and on full disks."""

from collections.abc import Callable
from contextlib import AbstractContextManager
from pathlib import Path

import numpy as np
import pytest

from coordinator.storage.recorder import BUFFERED, Recorder
from schema.errors import RunFolderError
from schema.tables.columns import POPULATION, TABLES
from schema.tables.files import parquet_path, read_table
from schema.tables.segments import segment_path
from tests.coordinator.records import DETAILS, check_complete, feed_rows, make_records
from tests.segments import write_segment

FullBeyond = Callable[[int], AbstractContextManager[None]]


def test_rows_are_read_before_and_after_the_end(tmp_path: Path) -> None:
    rows = make_records(20)
    recorder = feed_rows(tmp_path, rows)
    recorder.flush()
    check_complete(tmp_path, rows)
    recorder.finish()
    check_complete(tmp_path, rows)
    files = [path for path in tmp_path.rglob("*") if path.is_file()]
    assert sorted(files) == sorted(
        parquet_path(tmp_path, "a/b c", 2, name) for name in TABLES
    )


def test_enough_rows_are_on_disk_without_a_flush(tmp_path: Path) -> None:
    recorder = Recorder(tmp_path, DETAILS)
    births = [record for record in make_records(BUFFERED) if record.table == "births"]
    for record in births[:-1]:
        recorder.write(record)
    assert read_table(tmp_path, "births").num_rows == 0
    recorder.write(births[-1])
    assert read_table(tmp_path, "births").num_rows == BUFFERED
    recorder.close()


@pytest.mark.parametrize("seed", range(5))
def test_resumed_runs_write_the_same_rows_as_one(tmp_path: Path, seed: int) -> None:
    rng = np.random.default_rng(seed)
    rows = make_records(30)
    for stop in sorted(rng.integers(0, len(rows), 5)):
        # Each is killed after some rows: what waits is lost.
        feed_rows(tmp_path, rows[:stop], every=int(rng.integers(1, 20))).close()
    recorder = feed_rows(tmp_path, rows)
    recorder.finish()
    check_complete(tmp_path, rows)


@pytest.mark.parametrize("begun", [0, 10])
def test_rows_of_a_replaced_coordinator_count_once(tmp_path: Path, begun: int) -> None:
    """It pauses with buffered rows, before or after its first segment."""
    rows = make_records(30)
    old = feed_rows(tmp_path, rows[:begun])
    for record in rows[begun:25]:
        old.write(record)
    new = feed_rows(tmp_path, rows[:40])
    old.flush()
    for record in rows[40:60]:
        new.write(record)
    new.flush()
    old.close()
    check_complete(tmp_path, rows[:60])
    new.close()
    third = feed_rows(tmp_path, rows)
    third.finish()
    check_complete(tmp_path, rows)


def test_a_full_disk_loses_no_row(tmp_path: Path, full_beyond: FullBeyond) -> None:
    rows = make_records(20)
    recorder = feed_rows(tmp_path, rows[:20], every=20)
    size = segment_path(tmp_path, "births", 0).stat().st_size
    for record in rows[20:]:
        recorder.write(record)
    with full_beyond(size + 500), pytest.raises(RunFolderError, match="disk full"):
        recorder.flush()
    assert segment_path(tmp_path, "births", 0).stat().st_size == size
    recorder.flush()
    check_complete(tmp_path, rows)
    with full_beyond(1000), pytest.raises(RunFolderError, match="disk full"):
        recorder.finish()
    check_complete(tmp_path, rows)
    recorder.finish()
    check_complete(tmp_path, rows)


def test_a_segment_of_another_version_is_refused(tmp_path: Path) -> None:
    feed_rows(tmp_path, make_records(3)).close()
    path = segment_path(tmp_path, "population", 0)
    newer = POPULATION.with_metadata({"revolve.schema_version": "999"})
    write_segment(path, newer, [])
    with pytest.raises(RunFolderError, match="another version of Revolve"):
        Recorder(tmp_path, DETAILS)
