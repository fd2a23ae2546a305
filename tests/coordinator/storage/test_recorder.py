"""Rows of a run: written, resumed, and stored in bulk."""

from collections.abc import Callable
from contextlib import AbstractContextManager
from pathlib import Path

import numpy as np
import pytest
from msgspec.structs import replace

from coordinator.islands.events import Advanced
from coordinator.storage.recorder import BUFFERED, Recorder
from schema.errors import RunFolderError
from schema.robot.ids import BirthId
from schema.tables.columns import POPULATION, POSES, TABLES
from schema.tables.description import RunDetails
from schema.tables.files import parquet_path, read_table
from schema.tables.segments import segment_path, segments_of
from schema.wire.arena import NO_POSES, Advance
from tests.coordinator.arena_world import poses
from tests.coordinator.records import DETAILS, check_complete, feed_rows, make_records
from tests.coordinator.reports import PROVENANCE
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


SCENARIO = RunDetails("scenario3", 0, 1, "{}")


def bulk(number: int, rows: int = 3) -> Advanced:
    births = [BirthId(0, each) for each in range(rows)]
    sent = poses(births, float(number)).message()
    advance = Advance(number, bytes(32), (), (), (), sent)
    return Advanced(0, number, advance, rows, PROVENANCE)


def bare(event: Advanced) -> Advanced:
    """Return the replayed event of rows that are on disk."""
    return replace(event, advance=replace(event.advance, poses=NO_POSES))


def times(folder: Path) -> list[float]:
    table = read_table(folder, "poses")
    assert table["record"].to_pylist() == list(range(table.num_rows))
    found: list[float] = table["sim_time_s"].to_pylist()
    return found


def written(folder: Path, *numbers: int) -> Recorder:
    """Return a recorder that stored and counted some bulk rows."""
    recorder = Recorder(folder, SCENARIO)
    for number in numbers:
        recorder.poses.store(bulk(number))
        recorder.poses.take_advance(bulk(number))
    return recorder


def replayed(folder: Path, *numbers: int) -> Recorder:
    """Return a recorder that counted some bulk rows which are on disk."""
    recorder = Recorder(folder, SCENARIO)
    for number in numbers:
        recorder.poses.take_advance(bare(bulk(number)))
    return recorder


def test_bulk_rows_are_on_disk_when_they_are_stored(tmp_path: Path) -> None:
    recorder = Recorder(tmp_path, SCENARIO)
    recorder.poses.store(bulk(1))
    assert times(tmp_path) == [1.0] * 3
    recorder.poses.take_advance(bulk(1))
    assert times(tmp_path) == [1.0] * 3
    recorder.poses.take_advance(bulk(2))
    assert times(tmp_path) == [1.0] * 3 + [2.0] * 3


def test_bulk_rows_may_be_stored_ahead_of_the_count(tmp_path: Path) -> None:
    recorder = Recorder(tmp_path, SCENARIO)
    for number in (1, 2, 3):
        recorder.poses.store(bulk(number))
    for number in (1, 2, 3):
        recorder.poses.take_advance(bulk(number))
    recorder.poses.store(bulk(4))
    assert times(tmp_path)[::3] == [1.0, 2.0, 3.0, 4.0]


@pytest.mark.parametrize("kept", [0, 1, 2, 3])
def test_rows_without_a_journalled_event_are_removed(tmp_path: Path, kept: int) -> None:
    """Three advances were stored over two segments; the journal has a few of them."""
    written(tmp_path, 1, 2).close()
    second = replayed(tmp_path, 1, 2)
    second.poses.store(bulk(3))
    second.close()
    recorder = replayed(tmp_path, *range(1, kept + 1))
    recorder.poses.store(bulk(9))
    recorder.poses.take_advance(bulk(9))
    expected = [*map(float, range(1, kept + 1)), 9.0]
    assert times(tmp_path)[::3] == expected
    recorder.finish()
    assert times(tmp_path)[::3] == expected
    assert read_table(tmp_path, "poses").schema == POSES


def test_a_cut_segment_reads_on_after_a_kill(tmp_path: Path) -> None:
    written(tmp_path, 1, 2, 3).close()
    path = segment_path(tmp_path, "poses", 0)
    data = path.read_bytes()
    path.write_bytes(data[:-20])
    replayed(tmp_path, 1, 2).poses.store(bulk(3))
    assert times(tmp_path)[::3] == [1.0, 2.0, 3.0]


def test_missing_rows_are_refused(tmp_path: Path) -> None:
    written(tmp_path, 1).close()
    recorder = replayed(tmp_path, 1)
    with pytest.raises(RunFolderError, match="poses: rows 3 to 5 are missing"):
        recorder.poses.take_advance(bare(bulk(2)))


def test_no_rows_make_no_segment(tmp_path: Path) -> None:
    recorder = Recorder(tmp_path, SCENARIO)
    recorder.poses.store(bulk(1, rows=0))
    recorder.poses.take_advance(bulk(1, rows=0))
    assert segments_of(tmp_path, "poses") == []
