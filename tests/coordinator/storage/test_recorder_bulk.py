"""Bulk rows: stored before the journal has their event, counted after it."""

from pathlib import Path

import pytest
from msgspec.structs import replace

from coordinator.islands.events import Advanced
from coordinator.storage.recorder import Recorder
from schema.errors import RunFolderError
from schema.robot.ids import BirthId
from schema.tables.columns import POSES
from schema.tables.description import RunDetails
from schema.tables.files import read_table
from schema.tables.segments import segment_path, segments_of
from schema.wire.arena import NO_POSES, Advance
from tests.coordinator.arena_world import poses
from tests.coordinator.reports import PROVENANCE

DETAILS = RunDetails("scenario3", 0, 1, "{}")


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
    recorder = Recorder(folder, DETAILS)
    for number in numbers:
        recorder.store(bulk(number))
        recorder.append(bulk(number))
    return recorder


def replayed(folder: Path, *numbers: int) -> Recorder:
    """Return a recorder that counted some bulk rows which are on disk."""
    recorder = Recorder(folder, DETAILS)
    for number in numbers:
        recorder.append(bare(bulk(number)))
    return recorder


def test_bulk_rows_are_on_disk_when_they_are_stored(tmp_path: Path) -> None:
    recorder = Recorder(tmp_path, DETAILS)
    recorder.store(bulk(1))
    assert times(tmp_path) == [1.0] * 3
    recorder.append(bulk(1))
    assert times(tmp_path) == [1.0] * 3
    recorder.append(bulk(2))
    assert times(tmp_path) == [1.0] * 3 + [2.0] * 3


def test_bulk_rows_may_be_stored_ahead_of_the_count(tmp_path: Path) -> None:
    recorder = Recorder(tmp_path, DETAILS)
    for number in (1, 2, 3):
        recorder.store(bulk(number))
    for number in (1, 2, 3):
        recorder.append(bulk(number))
    recorder.store(bulk(4))
    assert times(tmp_path)[::3] == [1.0, 2.0, 3.0, 4.0]


@pytest.mark.parametrize("kept", [0, 1, 2, 3])
def test_rows_without_a_journalled_event_are_removed(tmp_path: Path, kept: int) -> None:
    """Three advances were stored over two segments; the journal has a few of them."""
    written(tmp_path, 1, 2).close()
    second = replayed(tmp_path, 1, 2)
    second.store(bulk(3))
    second.close()
    recorder = replayed(tmp_path, *range(1, kept + 1))
    recorder.store(bulk(9))
    recorder.append(bulk(9))
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
    replayed(tmp_path, 1, 2).store(bulk(3))
    assert times(tmp_path)[::3] == [1.0, 2.0, 3.0]


def test_missing_rows_are_refused(tmp_path: Path) -> None:
    written(tmp_path, 1).close()
    recorder = replayed(tmp_path, 1)
    with pytest.raises(RunFolderError, match="poses: rows 3 to 5 are missing"):
        recorder.append(bare(bulk(2)))


def test_no_rows_make_no_segment(tmp_path: Path) -> None:
    recorder = Recorder(tmp_path, DETAILS)
    recorder.store(bulk(1, rows=0))
    recorder.append(bulk(1, rows=0))
    assert segments_of(tmp_path, "poses") == []
