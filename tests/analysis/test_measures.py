"""Measures of hand-worked tables."""

import json
from collections.abc import Callable
from pathlib import Path

import pyarrow as pa
import pytest

from analysis.load import load_table, run_folders
from analysis.measures import final_fitness, progression
from schema.errors import RunFolderError


def _population(
    rows: list[tuple[str, str, int, float | None]], *, is_online: bool = False
) -> pa.Table:
    names = ["experiment", "folder", "births", "fitness"]
    columns = zip(*rows, strict=True)
    table = pa.table(dict(zip(names, map(list, columns), strict=True)))
    return table.append_column("is_online", pa.array([is_online] * len(rows)))


def test_progression_of_two_runs_and_of_another_experiment() -> None:
    table = _population(
        [
            # Run x of a: 0.1, 0.3 -> 0.2; then 0.5, 0.3 -> 0.4.
            ("a", "x", 15, 0.1),
            ("a", "x", 15, 0.3),
            ("a", "x", 30, 0.5),
            ("a", "x", 30, 0.3),
            # Run y of a: a failed one counts 0, so (0 + 0.8) / 2 = 0.4.
            ("a", "y", 15, None),
            ("a", "y", 15, 0.8),
            ("b", "z", 15, 0.25),
        ]
    )
    found = progression(table).to_pylist()
    assert [(row["experiment"], row["births"], row["runs"]) for row in found] == [
        ("a", 15, 2),
        ("a", 30, 1),
        ("b", 15, 1),
    ]
    assert [row["mean"] for row in found] == pytest.approx([0.3, 0.4, 0.25])
    assert [row["low"] for row in found] == pytest.approx([0.2, 0.4, 0.25])
    assert [row["high"] for row in found] == pytest.approx([0.4, 0.4, 0.25])


def test_final_fitness_is_that_of_each_run_s_own_last_population() -> None:
    table = _population(
        [
            ("a", "x", 15, 0.9),
            ("a", "x", 30, 0.5),
            ("a", "x", 30, None),
            ("a", "y", 15, 0.4),
            ("a", "y", 15, 0.2),
        ]
    )
    found = final_fitness(table).to_pylist()
    assert [(row["folder"], row["births"], row["size"]) for row in found] == [
        ("x", 30, 2),
        ("y", 15, 2),
    ]
    assert [row["mean"] for row in found] == pytest.approx([0.25, 0.3])
    assert [row["best"] for row in found] == [0.5, 0.4]


def test_in_an_arena_who_is_not_mature_does_not_count() -> None:
    rows = [("a", "x", 30, 0.2), ("a", "x", 30, None), ("a", "x", 30, 0.4)]
    table = _population(rows, is_online=True)
    assert progression(table)["mean"].to_pylist() == pytest.approx([0.3])
    (row,) = final_fitness(table).to_pylist()
    assert (row["size"], row["mean"]) == (2, pytest.approx(0.3))


@pytest.mark.parametrize("measure", [progression, final_fitness])
def test_nothing_born_is_said(measure: Callable[[pa.Table], pa.Table]) -> None:
    with pytest.raises(RunFolderError, match="nothing has been born"):
        measure(_population([("a", "x", 1, 0.0)]).slice(1))


def test_runs_are_found_below_and_named(tmp_path: Path) -> None:
    for name in ("two", "one"):
        folder = tmp_path / "all" / name
        folder.mkdir(parents=True)
        details = {"name": f"of-{name}", "document": json.dumps({"arena": None})}
        (folder / "run.json").write_text(json.dumps(details))
    folders = run_folders([tmp_path])
    assert [folder.name for folder in folders] == ["one", "two"]
    table = load_table(folders, "population")
    assert table.num_rows == 0
    assert {"experiment", "folder", "is_online"} <= set(table.column_names)


def test_no_run_is_said_with_where(tmp_path: Path) -> None:
    with pytest.raises(RunFolderError, match="no run is there or below"):
        run_folders([tmp_path])
