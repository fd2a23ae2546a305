"""Segments with checksums: damage is found before Arrow parses it, and named."""

import json
import logging
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from schema.errors import RunFolderError
from schema.tables import segments
from schema.tables.checksums import MAGIC, digest_of, sums_path
from schema.tables.columns import EVALUATIONS, TABLES
from schema.tables.files import parquet_path, read_table, stored_batches, stored_rows
from schema.tables.segments import segment_path, segments_of
from tests.schema.tables.test_files import ROW
from tests.segments import write_segment

BATCHES = 3


@pytest.fixture(autouse=True)
def _forget(caplog: pytest.LogCaptureFixture) -> None:
    """Forget what was named before, and record what is named."""
    segments.warn_once.cache_clear()
    caplog.set_level(logging.WARNING)


def batch(first: int) -> pa.RecordBatch:
    rows = [{**ROW, "record": first + each, "birth": 100 + first} for each in range(2)]
    return pa.RecordBatch.from_pylist(rows, EVALUATIONS)


def write(folder: Path, number: int = 0, first: int = 0) -> list[int]:
    """Write a segment of three batches of two rows; return the ends of its messages."""
    path = segment_path(folder, "evaluations", number)
    batches = [batch(first + 2 * each) for each in range(BATCHES)]
    (folder / "run.json").write_text('{"name": "any", "checksums": true}')
    return write_segment(path, EVALUATIONS, batches)


def flip(path: Path, byte: int, bit: int = 0) -> None:
    data = bytearray(path.read_bytes())
    data[byte] ^= 1 << bit
    path.write_bytes(data)


def births(folder: Path) -> list[int]:
    found: list[int] = read_table(folder, "evaluations")["birth"].to_pylist()
    return found


WHOLE = [100, 100, 102, 102, 104, 104]


def test_every_flipped_byte_ends_the_sound_part(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    ends = write(tmp_path)
    path = segment_path(tmp_path, "evaluations", 0)
    rng = np.random.default_rng(1)
    for byte in rng.integers(0, ends[-1], 200):
        caplog.clear()
        segments.warn_once.cache_clear()
        flip(path, byte, byte % 8)
        whole = sum(end <= byte for end in ends)
        assert births(tmp_path) == WHOLE[: 2 * max(0, whole - 1)]
        (message,) = caplog.messages
        start = ends[whole - 1] if whole else 0
        assert f"{path}: damaged at byte {start}: wrong checksum" in message
        assert "resume the run" in message
        flip(path, byte, byte % 8)
    assert births(tmp_path) == WHOLE


def test_every_flipped_byte_of_the_checksums_is_named(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    write(tmp_path)
    sums = sums_path(segment_path(tmp_path, "evaluations", 0))
    for byte in range(sums.stat().st_size):
        caplog.clear()
        segments.warn_once.cache_clear()
        flip(sums, byte)
        found = births(tmp_path)
        assert found == WHOLE[: len(found)]
        assert len(found) < len(WHOLE)
        (message,) = caplog.messages
        assert f"{sums}: damaged at byte" in message
        flip(sums, byte)


def test_damage_is_named_once(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    ends = write(tmp_path)
    flip(segment_path(tmp_path, "evaluations", 0), ends[1] + 5)
    assert births(tmp_path) == births(tmp_path) == WHOLE[:2]
    assert len(caplog.messages) == 1


@pytest.mark.parametrize("cut", ["segment", "sums"])
def test_missing_tail_of_either_file_loses_only_what_was_in_it(
    tmp_path: Path, caplog: pytest.LogCaptureFixture, cut: str
) -> None:
    ends = write(tmp_path)
    segment = segment_path(tmp_path, "evaluations", 0)
    path = segment if cut == "segment" else sums_path(segment)
    data = path.read_bytes()
    for size in range(0, len(data), 1 if cut == "sums" else 37):
        caplog.clear()
        segments.warn_once.cache_clear()
        path.write_bytes(data[:size])
        if cut == "segment":
            whole = sum(end <= size for end in ends)
            # The checksums say how long the file must be.
            births(tmp_path)
            assert f"must have {ends[whole]} bytes" in caplog.messages[0]
        else:
            whole = max(0, size - len(MAGIC)) // (len(data[len(MAGIC) :]) // 4)
        assert births(tmp_path) == WHOLE[: 2 * max(0, whole - 1)]


def test_bytes_without_a_checksum_do_not_count(tmp_path: Path) -> None:
    """A batch is cut, or its checksum is not written yet."""
    write(tmp_path)
    path = segment_path(tmp_path, "evaluations", 0)
    sums = sums_path(path)
    for extra in (b"x", batch(6).serialize().to_pybytes(), bytes(10_000)):
        with path.open("ab") as file:
            file.write(extra)
        assert births(tmp_path) == WHOLE
    with sums.open("ab") as file:
        file.write(b"short")
    assert births(tmp_path) == WHOLE


@pytest.mark.parametrize("is_made", [False, True])
def test_a_kill_while_the_files_are_made_is_no_damage(
    tmp_path: Path, caplog: pytest.LogCaptureFixture, *, is_made: bool
) -> None:
    write(tmp_path)
    path = segment_path(tmp_path, "evaluations", 1)
    if is_made:
        path.touch()
    for written in range(len(MAGIC) + 1):
        sums_path(path).write_bytes(MAGIC[:written])
        assert births(tmp_path) == WHOLE
    assert caplog.messages == []


@pytest.mark.parametrize("lost", ["segment", "sums"])
def test_a_lost_file_is_named(
    tmp_path: Path, caplog: pytest.LogCaptureFixture, lost: str
) -> None:
    write(tmp_path)
    segment = segment_path(tmp_path, "evaluations", 0)
    path = segment if lost == "segment" else sums_path(segment)
    path.unlink()
    assert births(tmp_path) == []
    (message,) = caplog.messages
    assert f"{path}: damaged at byte 0: the file is missing" in message


def test_rows_behind_damage_are_a_gap(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    ends = write(tmp_path)
    write(tmp_path, number=1, first=6)
    assert len(births(tmp_path)) == 12
    flip(segment_path(tmp_path, "evaluations", 0), ends[1] + 20)
    assert births(tmp_path) == WHOLE[:2]
    assert "rows 2 to 5 of evaluations are lost" in caplog.messages[1]
    stored = stored_rows(tmp_path, "evaluations")
    assert stored.rows == 2
    assert [last and last.end for last in stored.used.values()] == [ends[1]]
    assert stored.unused == [segment_path(tmp_path, "evaluations", 1)]


@pytest.mark.parametrize("is_same", [True, False])
def test_only_segments_of_the_present_columns_are_read(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, *, is_same: bool
) -> None:
    """Other descriptions do not matter."""
    write(tmp_path)
    fields = [field.with_metadata({"unit": "furlong"}) for field in EVALUATIONS]
    present = pa.schema(fields if is_same else fields[:-1], EVALUATIONS.metadata)
    monkeypatch.setitem(TABLES, "evaluations", present)
    path = segment_path(tmp_path, "evaluations", 0)
    if is_same:
        assert len(list(segments.read_segment(tmp_path, "evaluations", path))) == 3
        return
    with pytest.raises(RunFolderError, match="another version of Revolve"):
        list(segments.read_segment(tmp_path, "evaluations", path))


def test_foreign_files_are_no_segments(tmp_path: Path) -> None:
    write(tmp_path)
    for name in ("evaluations-x.arrows", "evaluations-1.arrows.bak", "evaluations-"):
        (tmp_path / "segments" / name).touch()
    assert [number for number, _ in segments_of(tmp_path, "evaluations")] == [0]


def test_a_run_that_ends_while_it_is_read_gives_all_rows_without_a_word(
    tmp_path: Path, caplog: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch
) -> None:
    write(tmp_path)
    whole = read_table(tmp_path, "evaluations")
    path = segment_path(tmp_path, "evaluations", 0)

    def ending(folder: Path, table: str) -> Iterator[pa.RecordBatch]:
        finished = parquet_path(folder, "any", 0, table)
        finished.parent.mkdir(parents=True)
        pq.write_table(whole, finished)
        entries = {"checksums": True, "digests": {table: digest_of(finished)}}
        (folder / "run.json").write_text(json.dumps(entries))
        path.unlink()
        return stored_batches(folder, table)

    monkeypatch.setattr("schema.tables.files.batches_by_island", ending)
    assert read_table(tmp_path, "evaluations").equals(whole)
    assert caplog.messages == []
