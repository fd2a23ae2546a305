"""Reading of tables: those of earlier versions, and the rows of several islands."""

import json
from collections.abc import Iterator
from hashlib import sha256
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from msgspec.structs import replace

from schema.errors import RunFolderError
from schema.tables import files
from schema.tables.columns import EVALUATIONS, TABLES
from schema.tables.description import Description, description_text, run_columns
from schema.tables.files import (
    batches_by_island,
    parquet_path,
    read_table,
    stored_batches,
)
from schema.tables.segments import segment_path
from tests.segments import write_segment

ROW = {
    "record": 0,
    "island": 0,
    "birth_island": None,
    "birth": 7,
    "trial": 3,
    "status": "ok",
    "reason": "",
    "fitness": 0.5,
    "path_velocity": 0.1,
    "straight_velocity": 0.08,
    "simulated_s": 12.0,
    "wall_s": 0.1,
    "worker": "w",
    "platform": "p",
    "measures": [("height", 0.1), ("turning", 2.0)],
    "point": None,
    "seed": 7,
    "run_id": "0123456789ab",
}
DESCRIPTION = Description("old", 0, 2**64 - 1, "{}", nonce="a5d3c0ab")


def without(*names: str) -> pa.Table:
    """Return one row of the table as it was before it had some columns."""
    kept = [field for field in EVALUATIONS if field.name not in names]
    return pa.Table.from_pylist([ROW], pa.schema(kept, EVALUATIONS.metadata))


def write_parquet(folder: Path, rows: pa.Table) -> None:
    path = parquet_path(folder, "old", 0, "evaluations")
    path.parent.mkdir(parents=True)
    pq.write_table(rows, path)


def test_evaluations_of_older_runs_have_trial_0(tmp_path: Path) -> None:
    write_parquet(tmp_path, without("trial"))
    found = read_table(tmp_path, "evaluations")
    assert found.schema.equals(TABLES["evaluations"], check_metadata=True)
    assert found.to_pylist() == [{**ROW, "trial": 0}]


def test_present_rows_are_read_unchanged(tmp_path: Path) -> None:
    write_parquet(tmp_path, without())
    assert read_table(tmp_path, "evaluations").to_pylist() == [ROW]


def test_rows_of_older_runs_get_seed_and_id_of_their_run(tmp_path: Path) -> None:
    write_parquet(tmp_path, without("seed", "run_id"))
    (tmp_path / "run.json").write_text(description_text(DESCRIPTION))
    (row,) = read_table(tmp_path, "evaluations").to_pylist()
    assert row == {**ROW, "seed": 2**64 - 1, "run_id": run_columns(tmp_path)["run_id"]}


def test_run_columns_are_null_without_a_description(tmp_path: Path) -> None:
    write_parquet(tmp_path, without("seed", "run_id"))
    (row,) = read_table(tmp_path, "evaluations").to_pylist()
    assert row == {**ROW, "seed": None, "run_id": None}


def test_run_id_is_that_of_one_run(tmp_path: Path) -> None:
    def columns(description: Description) -> dict[str, int | str | None]:
        (tmp_path / "run.json").write_text(description_text(description))
        return run_columns(tmp_path)

    own = columns(DESCRIPTION)
    # Worked out by hand: the SHA-256 of ["old",0,18446744073709551615,"{}","a5d3c0ab"].
    assert own == {"seed": 2**64 - 1, "run_id": "2d5796dcc131"}
    assert columns(replace(DESCRIPTION, checksums=True, digests={"births": "1"})) == own
    others = [
        replace(DESCRIPTION, run=1),
        replace(DESCRIPTION, seed=1),
        replace(DESCRIPTION, document="{ }"),
        replace(DESCRIPTION, nonce="b"),
    ]
    ids = {columns(each)["run_id"] for each in others}
    assert len(ids | {own["run_id"]}) == 1 + len(others)


def relabelled(**changes: str | None) -> pa.Table:
    """Return one row whose columns have other metadata; None removes a key."""
    rows = without()
    fields = []
    for field in rows.schema:
        known = {key.decode(): text.decode() for key, text in field.metadata.items()}
        found = {**known, **changes}
        kept = {key: text for key, text in found.items() if text is not None}
        fields.append(field.with_metadata(kept))
    metadata = dict(EVALUATIONS.metadata)
    del metadata[b"description"]
    return rows.cast(pa.schema(fields, metadata))


def test_descriptions_and_units_of_earlier_runs_are_replaced(tmp_path: Path) -> None:
    write_parquet(tmp_path, relabelled(description=None, unit="furlong"))
    found = read_table(tmp_path, "evaluations")
    assert found.to_pylist() == [ROW]
    assert found.schema.equals(EVALUATIONS, check_metadata=True)


def test_a_nullable_column_is_null_in_older_rows(tmp_path: Path) -> None:
    write_parquet(tmp_path, without("fitness"))
    assert read_table(tmp_path, "evaluations")["fitness"].to_pylist() == [None]


def test_file_without_a_required_column_is_refused(tmp_path: Path) -> None:
    write_parquet(tmp_path, without("status"))
    with pytest.raises(RunFolderError, match="cannot be read"):
        read_table(tmp_path, "evaluations")


def sealed(folder: Path) -> Path:
    """Write a finished table with its digest; return its path."""
    write_parquet(folder, without())
    path = parquet_path(folder, "old", 0, "evaluations")
    digest = sha256(path.read_bytes()).hexdigest()
    entries = {"name": "old", "checksums": True, "digests": {"evaluations": digest}}
    (folder / "run.json").write_text(json.dumps(entries))
    return path


def test_every_flipped_byte_of_a_finished_table_is_named(tmp_path: Path) -> None:
    path = sealed(tmp_path)
    data = path.read_bytes()
    read_table(tmp_path, "evaluations")
    for byte in range(0, len(data), 97):
        path.write_bytes(
            data[:byte] + bytes([data[byte] ^ 1 << byte % 8]) + data[byte + 1 :]
        )
        with pytest.raises(RunFolderError, match=r"evaluations\.parquet: damaged"):
            read_table(tmp_path, "evaluations")


@pytest.mark.parametrize("content", [b"", b"PAR1", None])
def test_lost_and_empty_finished_tables_are_named(
    tmp_path: Path, content: bytes | None
) -> None:
    path = sealed(tmp_path)
    if content is None:
        path.unlink()
    else:
        path.write_bytes(content)
    with pytest.raises(RunFolderError, match="resume the run to write it again"):
        read_table(tmp_path, "evaluations")


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
