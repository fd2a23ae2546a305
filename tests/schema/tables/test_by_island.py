"""Rows of several islands: sorted by island, in few passes over the segments."""

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pyarrow as pa
import pytest

from schema.tables import files
from schema.tables.columns import EVALUATIONS
from schema.tables.files import batches_by_island, read_table, stored_batches
from schema.tables.segments import segment_path
from tests.schema.tables.test_files import ROW
from tests.segments import write_segment

ISLANDS = 12
ROWS = 100


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Return a run whose rows of all islands are mixed, in batches of 1 to 4 rows."""
    rng = np.random.default_rng(3)
    rows = [
        {**ROW, "record": number, "island": int(island), "birth": 1000 + number}
        for number, island in enumerate(rng.integers(0, ISLANDS, ROWS))
    ]
    batches = []
    while rows:
        size = int(rng.integers(1, 5))
        batches.append(pa.RecordBatch.from_pylist(rows[:size], EVALUATIONS))
        rows = rows[size:]
    write_segment(segment_path(tmp_path, "evaluations", 0), EVALUATIONS, batches)
    return tmp_path


def count_passes(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Return a list that gets the table's name at each reading of its segments."""
    passes: list[str] = []

    def counted(folder: Path, table: str) -> Iterator[pa.RecordBatch]:
        passes.append(table)
        return stored_batches(folder, table)

    monkeypatch.setattr(files, "stored_batches", counted)
    return passes


@pytest.mark.parametrize(
    ("share", "most"), [(0.0, 1 + ISLANDS), (0.3, 1 + ISLANDS // 2), (1.0, 2)]
)
def test_rows_are_sorted_by_island_and_numbered_anew(
    folder: Path, monkeypatch: pytest.MonkeyPatch, share: float, most: int
) -> None:
    """The first pass counts the rows of each island."""
    batches = list(stored_batches(folder, "evaluations"))
    size = int(share * sum(batch.nbytes for batch in batches))
    monkeypatch.setattr(files, "SORTED_BYTES", size)
    rows = pa.Table.from_batches(batches).to_pylist()
    rows.sort(key=lambda row: row["island"])
    passes = count_passes(monkeypatch)
    found = list(batches_by_island(folder, "evaluations"))
    assert len(passes) <= most
    assert all(batch.num_rows for batch in found)
    expected = [{**row, "record": number} for number, row in enumerate(rows)]
    assert pa.Table.from_batches(found, EVALUATIONS).to_pylist() == expected
    assert read_table(folder, "evaluations").to_pylist() == expected
