"""Damaged segments: cut at the last sound batch when they are opened, written again."""

import os
from hashlib import sha256
from pathlib import Path

import numpy as np
import pyarrow as pa
import pytest

from coordinator.storage.folder import RunFolder, read_details
from coordinator.storage.recorder import Recorder, Segment
from coordinator.storage.rewriting import remove_segment
from schema.errors import RunFolderError
from schema.tables.checksums import sums_path
from schema.tables.columns import BIRTHS, TABLES
from schema.tables.description import read_description
from schema.tables.files import parquet_path, read_table
from schema.tables.segments import read_segment, segment_path, segments_of, warn_once
from tests.coordinator.records import DETAILS, check_complete, feed_rows, make_records


def flip(path: Path, byte: int) -> None:
    data = bytearray(path.read_bytes())
    data[byte] ^= 16
    path.write_bytes(data)


@pytest.mark.parametrize("seed", range(30))
def test_damage_anywhere_is_written_again(tmp_path: Path, seed: int) -> None:
    rng = np.random.default_rng(seed)
    rows = make_records(20)
    feed_rows(tmp_path, rows[:20], every=4).close()
    feed_rows(tmp_path, rows[:40], every=4).close()
    files = sorted((tmp_path / "segments").iterdir())
    path = files[rng.integers(len(files))]
    match seed % 3:
        case 0:
            flip(path, int(rng.integers(path.stat().st_size)))
        case 1:
            os.truncate(path, int(rng.integers(path.stat().st_size)))
        case _:
            path.unlink()
    recorder = feed_rows(tmp_path, rows)
    recorder.flush()
    check_complete(tmp_path, rows)
    recorder.finish()
    check_complete(tmp_path, rows)
    assert not (tmp_path / "segments").exists()


def test_an_opened_segment_is_cut_with_its_checksums(tmp_path: Path) -> None:
    rows = [each for each in make_records(6) if each.table == "births"]
    feed_rows(tmp_path, rows, every=1).close()
    path = segment_path(tmp_path, "births", 0)
    ends = [batch.end for batch in read_segment(tmp_path, "births", path)]
    size = sums_path(path).stat().st_size
    flip(path, ends[2] + 3)
    Recorder(tmp_path, DETAILS).close()
    assert path.stat().st_size == ends[2]
    assert sums_path(path).stat().st_size == size - 3 * 16
    assert read_table(tmp_path, "births").num_rows == 3
    flip(path, 3)
    Recorder(tmp_path, DETAILS).close()
    assert segments_of(tmp_path, "births") == []


@pytest.mark.parametrize("removed", [0, 1])
def test_a_kill_while_a_segment_is_removed_is_no_damage(
    tmp_path: Path,
    *,
    caplog: pytest.LogCaptureFixture,
    monkeypatch: pytest.MonkeyPatch,
    removed: int,
) -> None:
    rows = [each for each in make_records(6) if each.table == "births"]
    feed_rows(tmp_path, rows, every=1).close()
    path = segment_path(tmp_path, "births", 0)
    files: list[Path] = []
    unlink = Path.unlink

    def stop(file: Path) -> None:
        if len(files) == removed:
            raise KeyboardInterrupt
        files.append(file)
        unlink(file)

    monkeypatch.setattr(Path, "unlink", stop)
    with pytest.raises(KeyboardInterrupt):
        remove_segment(path)
    (tmp_path / "run.json").write_text('{"name": "any", "checksums": true}')
    warn_once.cache_clear()
    assert read_table(tmp_path, "births").num_rows == 0
    assert caplog.messages == []


def test_a_batch_whose_checksum_cannot_be_written_is_removed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = segment_path(tmp_path, "births", 0)
    path.parent.mkdir()
    segment = Segment(path, BIRTHS)
    before = path.stat().st_size, sums_path(path).stat().st_size
    batch = pa.RecordBatch.from_pylist([], BIRTHS)

    def fail(end: int, message: memoryview) -> bytes:
        raise RunFolderError(f"disk full at {end}, {len(message)} bytes")

    with monkeypatch.context() as context:
        context.setattr("coordinator.storage.recorder._record", fail)
        with pytest.raises(RunFolderError, match="disk full"):
            segment.append(batch)
    assert (path.stat().st_size, sums_path(path).stat().st_size) == before
    segment.append(batch)
    segment.close()
    assert len(list(read_segment(tmp_path, "births", path))) == 1


def test_damage_before_the_end_is_mended_by_the_next_start(tmp_path: Path) -> None:
    rows = make_records(20)
    recorder = feed_rows(tmp_path, rows)
    recorder.flush()
    flip(segment_path(tmp_path, "births", 0), 2000)
    with pytest.raises(RunFolderError, match="resume the run to write them again"):
        recorder.finish()
    recorder.close()
    feed_rows(tmp_path, rows).finish()
    check_complete(tmp_path, rows)


def test_finished_tables_are_sealed_in_the_description(tmp_path: Path) -> None:
    rows = make_records(5)
    folder = tmp_path / "run"
    with RunFolder(folder, DETAILS) as held:
        began = (folder / "run.json").stat().st_mtime_ns
        recorder = Recorder(folder, DETAILS, seal=held.seal)
        for record in rows:
            recorder.write(record)
        assert read_description(folder).digests == {}
        recorder.finish()
        name = held.name
    seal = read_description(folder)
    assert seal.checksums
    assert seal.digests == {
        name: sha256(
            parquet_path(folder, DETAILS.name, DETAILS.run, name).read_bytes()
        ).hexdigest()
        for name in TABLES
    }
    assert (folder / "run.json").stat().st_mtime_ns == began
    assert read_details(folder) == DETAILS
    with RunFolder(folder) as again:
        assert again.name == name
