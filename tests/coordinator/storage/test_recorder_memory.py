"""Memory for the end of a run and for its readers: the same for any number of rows."""

from collections.abc import Callable
from functools import partial
from pathlib import Path

import pyarrow as pa
import pyarrow.compute as pc
import pytest

from coordinator.storage.recorder import Recorder, Segment
from schema.tables import files
from schema.tables.columns import TABLES
from schema.tables.description import RunDetails
from schema.tables.files import read_table
from schema.tables.segments import SEGMENTS, segment_path
from tests.coordinator.records import birth_row

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
