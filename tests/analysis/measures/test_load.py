"""Tests of damaged, unfinished and duplicate runs, and runs of other versions."""

import errno
import json
import shutil
from collections.abc import Callable, Iterable
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest

from analysis.measures.load import LeftOut, LoadedRun, read_runs, read_tables
from analysis.measures.study import MeasuredRun, measure_run, measure_runs
from schema.errors import RunFolderError
from schema.tables.description import run_columns
from schema.tables.files import parquet_path
from schema.tables.segments import segment_path
from tests.analysis.tables import births, population, table
from tests.segments import write_segment

A, B, C = ((0, number) for number in range(3))
LIVING = population((0, 2, {A: 0.1, B: 0.3}), (0, 3, {B: 0.3, C: 0.5}))
ROWS = {
    "births": births((A, []), (B, []), (C, [A, B])),
    "population": LIVING.drop_columns("is_online"),
    "evaluations": table(
        "evaluations",
        [
            {"birth": birth, "status": "ok", "fitness": fitness}
            for birth, fitness in enumerate((0.1, 0.3, 0.5))
        ],
    ),
}
Maker = Callable[..., Path]


def describe(folder: Path, seed: int = 1, **document: object) -> None:
    """Write the description of a run, with its document."""
    written = json.dumps({"name": "e", "births": 3, **document})
    details = {"name": "e", "run": 0, "seed": seed, "document": written}
    (folder / "run.json").write_text(json.dumps(details))


@pytest.fixture
def made(tmp_path: Path) -> Maker:
    """Return a function that makes a run folder, finished or not."""

    def make(
        name: str, *, seed: int = 1, state: str = "finished", **document: object
    ) -> Path:
        folder = tmp_path / name
        folder.mkdir()
        describe(folder, seed, **document)
        (folder / "state").write_text(state)
        for table_name, rows in ROWS.items():
            if state == "finished":
                path = parquet_path(folder, "e", 0, table_name)
                path.parent.mkdir(parents=True, exist_ok=True)
                pq.write_table(rows, path)
            else:
                path = segment_path(folder, table_name, 0)
                write_segment(path, rows.schema, rows.to_batches(max_chunksize=1))
        return folder

    return make


def names(folders: Iterable[LoadedRun | LeftOut]) -> list[str]:
    return [Path(one.folder).name for one in folders]


def whys(measured: MeasuredRun) -> dict[str, str]:
    return {one.what: one.why for one in measured.left_out}


def found_in(folder: Path) -> LoadedRun:
    (run,), left_out = read_runs([folder])
    assert not left_out
    return run


def fitness(measured: MeasuredRun) -> list[float]:
    values: list[float] = measured.tables["populations"]["fitness"].to_pylist()
    return values


@pytest.mark.parametrize("state", ["finished", "running", "stopped"])
def test_finished_and_unfinished_runs_are_measured_alike(
    made: Maker, state: str
) -> None:
    folder = made("x", state=state)
    measured = measure_run(found_in(folder), "parent")
    assert fitness(measured) == pytest.approx([0.2, 0.4])
    assert measured.tables["robots"].num_rows == 3
    (row,) = measured.tables["runs"].to_pylist()
    # As in the run's own tables, which are written with these columns.
    assert row["run_id"] == run_columns(folder)["run_id"] is not None
    expected = {} if state == "finished" else {
        "comparison": "the run is not finished: 3 of 3 births are recorded"
    }  # fmt: skip
    assert whys(measured) == expected


def test_runs_are_found_below_in_order(made: Maker, tmp_path: Path) -> None:
    with pytest.raises(RunFolderError, match="no run in or below this folder"):
        read_runs([tmp_path])
    with pytest.raises(RunFolderError, match="nowhere: no such folder"):
        read_runs([tmp_path / "nowhere"])
    for number, name in enumerate(("two", "one")):
        made(name, seed=number)
    runs, left_out = read_runs([tmp_path, tmp_path / "one"])
    assert [(run.folder.name, run.seed) for run in runs] == [("one", 1), ("two", 0)]
    assert not left_out


@pytest.mark.parametrize(
    "text", ["", "[]", "{}", '{"name": 1}', '{"document": "{}", "name": "e"}', "\x00"]
)
def test_an_unreadable_description_is_reported_and_others_are_read(
    made: Maker, tmp_path: Path, text: str
) -> None:
    (made("broken", seed=2) / "run.json").write_text(text)
    with pytest.raises(RunFolderError, match=r"no run can be read: .*: run.json: "):
        read_runs([tmp_path])
    made("whole")
    runs, left_out = read_runs([tmp_path])
    assert (names(runs), names(left_out)) == (["whole"], ["broken"])
    assert left_out[0].why.startswith("run.json: ")


def test_a_finished_run_is_read_without_its_description(made: Maker) -> None:
    folder = made("x")
    document = json.dumps({"name": "e", "births": 3})
    row = {"name": "e", "run": 4, "seed": 9, "document": document, "state": "finished"}
    path = parquet_path(folder, "e", 0, "runs")
    row |= {"start": 0, "end": 0}
    pq.write_table(table("runs", [row]), path)
    (folder / "run.json").unlink()
    (folder / "state").unlink()
    run = found_in(folder)
    assert (run.number, run.seed, run.state) == (4, 9, "finished")
    assert fitness(measure_run(run, "parent")) == pytest.approx([0.2, 0.4])


def damaged(folder: Path, *tables: str) -> None:
    for name in tables:
        parquet_path(folder, "e", 0, name).write_bytes(b"")


def test_of_equal_runs_the_whole_finished_long_one_counts(
    made: Maker, tmp_path: Path
) -> None:
    made("a", state="running")
    shutil.copytree(made("b"), tmp_path / "c")
    runs, left_out = read_runs([tmp_path])
    assert (names(runs), names(left_out)) == (["b"], ["c", "a"])
    assert {one.why for one in left_out} == {f"the same run as {tmp_path / 'b'}"}
    damaged(tmp_path / "b", "population")
    shutil.copytree(tmp_path / "b", tmp_path / "d")
    runs, left_out = read_runs([tmp_path])
    assert names(runs) == ["c"]
    same = f"the same run as {tmp_path / 'c'}"
    broken = f"{same}, and not completely readable"
    assert {Path(one.folder).name: one.why for one in left_out} == {
        "a": same, "b": broken, "d": broken,
    }  # fmt: skip
    for name in ("c", "d"):
        shutil.rmtree(tmp_path / name / "tables")
    shutil.rmtree(tmp_path / "b")
    path = segment_path(tmp_path / "a", "births", 0)
    shutil.copytree(tmp_path / "a", tmp_path / "e")
    path.write_bytes(path.read_bytes()[:-100])
    assert names(read_runs([tmp_path])[0]) == ["e"]


def test_runs_with_another_source_of_a_plug_in_are_different_runs(
    made: Maker, tmp_path: Path
) -> None:
    digests = {"a": "1a", "b": "1a", "c": "2b", "d": None}
    for name, digest in digests.items():
        file = made(name, fitness={"function": "goals:fast"}) / "run.json"
        if digest:
            plugins = {"goals": {"digest": digest}}
            details = {**json.loads(file.read_text()), "plugins": plugins}
            file.write_text(json.dumps(details))
    runs, left_out = read_runs([tmp_path])
    assert [(run.folder.name, run.fitness, run.plugins) for run in runs] == [
        ("a", "goals:fast (source 1a)", {"goals": "1a"}),
        ("c", "goals:fast (source 2b)", {"goals": "2b"}),
        ("d", "goals:fast (source unknown)", {"goals": "unknown"}),
    ]
    assert names(left_out) == ["b"]


def test_the_beginning_of_a_longer_run_is_not_another_run(
    made: Maker, tmp_path: Path
) -> None:
    islands: list[dict[str, object]] = [{"births": 3}]
    made("a", births=2, islands=islands)
    made("b", islands=[{"births": 4}])
    made("c", islands=islands, arena={})
    made("d", islands=islands)
    damaged(tmp_path / "a", "population")
    runs, left_out = read_runs([tmp_path])
    assert names(runs) == ["b", "c"]
    part = f"part of {tmp_path / 'b'}"
    assert [(Path(one.folder).name, one.why) for one in left_out] == [
        ("d", part),
        ("a", f"{part}, and not completely readable"),
    ]


@pytest.mark.parametrize(
    ("chosen", "name"),
    [
        ({}, "e-4"),
        ({"space.max_parts": 9}, "e"),
        ({"space.max_parts": 9, "fitness.parameters.far": 0.5}, "e-far=0.5"),
    ],
)
def test_points_of_a_sweep_with_another_fitness_are_other_experiments(
    made: Maker, chosen: dict[str, object], name: str
) -> None:
    file = made("a", sweep={"settings": {}, "chosen": chosen}) / "run.json"
    details = {**json.loads(file.read_text()), "name": "e-4"}
    file.write_text(json.dumps(details))
    assert found_in(file.parent).experiment == name


def test_a_run_without_tables_is_reported(made: Maker, tmp_path: Path) -> None:
    made("whole")
    shutil.rmtree(made("gone", seed=2) / "tables")
    runs, left_out = read_runs([tmp_path])
    assert (names(runs), names(left_out)) == (["whole"], ["gone"])
    assert left_out[0].why == "the run is finished, but its tables are missing"
    folder = made("x", state="running")
    shutil.rmtree(folder / "segments")
    assert whys(measure_run(found_in(folder), "parent")) == {
        "measures": "no population is recorded",
        "comparison": "the run is not finished: 0 of 3 births are recorded",
    }


@pytest.mark.parametrize("name", ["births", "population", "evaluations"])
def test_a_missing_table_of_a_finished_run_is_reported(made: Maker, name: str) -> None:
    folder = made("x")
    parquet_path(folder, "e", 0, name).unlink()
    measured = measure_run(found_in(folder), "parent")
    why = "missing, although the run is finished"
    assert whys(measured)[f"table {name}"] == why
    assert whys(measured)["measure robots"] == f"needs table {name}"


def test_a_missing_table_of_an_arena_is_reported(made: Maker) -> None:
    folder = made("x", arena={"record_touches": True})
    missing = {one.what for one in read_tables(found_in(folder))[1]}
    assert missing == {"table fitness", "table deaths", "table touches"}


def test_a_damaged_table_is_reported_and_others_are_measured(made: Maker) -> None:
    folder = made("x")
    path = parquet_path(folder, "e", 0, "evaluations")
    path.write_bytes(path.read_bytes()[:-20])
    measured = measure_run(found_in(folder), "parent")
    assert fitness(measured) == pytest.approx([0.2, 0.4])
    assert "Parquet" in whys(measured)["table evaluations"]
    # Robots are left out, because some may be missing.
    assert whys(measured)["measure robots"] == "needs table evaluations"
    assert "robots" not in measured.tables


def test_a_table_of_another_version_is_reported_and_skipped(made: Maker) -> None:
    folder = made("x")
    path = parquet_path(folder, "e", 0, "population")
    old = ROWS["population"].replace_schema_metadata({"revolve.schema_version": "1"})
    pq.write_table(old, path)
    measured = measure_run(found_in(folder), "parent")
    assert measured.tables["populations"].num_rows == 0
    assert (
        "has version 1, but this program reads version 2"
        in whys(measured)["table population"]
    )
    assert whys(measured)["measures"] == "no population is recorded"


def test_a_segment_of_another_version_is_reported(made: Maker) -> None:
    folder = made("x", state="running")
    path = segment_path(folder, "births", 0)
    rows = ROWS["births"].rename_columns(
        ["rank_" if name == "rank" else name for name in ROWS["births"].column_names]
    )
    write_segment(path, rows.schema, rows.to_batches())
    measured = measure_run(found_in(folder), "parent")
    assert "another version" in whys(measured)["table births"]
    assert "2 populations skipped" in whys(measured)["populations"]


def test_missing_columns_of_an_older_run_are_filled(made: Maker) -> None:
    folder = made("x")
    for name, column in (("population", "birth_island"), ("evaluations", "trial")):
        path = parquet_path(folder, "e", 0, name)
        pq.write_table(ROWS[name].drop_columns(column), path)
    measured = measure_run(found_in(folder), "parent")
    assert fitness(measured) == pytest.approx([0.2, 0.4])
    assert not measured.left_out


@pytest.mark.parametrize("kept", np.linspace(0.3, 0.99, 6).tolist())
def test_a_truncated_segment_loses_only_its_last_rows(made: Maker, kept: float) -> None:
    folder = made("x", state="running")
    path = segment_path(folder, "births", 0)
    data = path.read_bytes()
    path.write_bytes(data[: int(len(data) * kept)])
    tables, left_out = read_tables(found_in(folder))
    assert not left_out
    known = tables["births"].num_rows
    assert known < 3
    measured = measure_run(found_in(folder), "parent")
    # The population of founders needs two births, the next one three.
    assert fitness(measured) == pytest.approx([0.2] if known == 2 else [])
    why = whys(measured)["populations"]
    assert why.startswith("1 population" if known == 2 else "2 population")


def test_islands_have_their_own_settings(made: Maker) -> None:
    islands = [{"count": 2, "births": 5}, {"arena": {"record_touches": True}}, {}]
    folder = made("x", islands=islands)
    settings = found_in(folder).islands
    assert [one.births for one in settings] == [5, 5, 3, 3]
    assert [n for n, one in enumerate(settings) if one.arena] == [2]
    for name in ("fitness", "deaths", "touches", "migrations"):
        pq.write_table(table(name, []), parquet_path(folder, "e", 0, name))
    measured = measure_run(found_in(folder), "parent")
    assert {"between", "migrants", "variability"} <= set(measured.tables)


def test_immigrants_keep_their_birth_id(made: Maker) -> None:
    folder = made("x")
    rows: list[dict[str, object]] = [
        {"island": 1, "births": 3, "birth_island": 0, "birth": 2, "fitness": 1.0},
        {"island": 0, "births": 3, "birth_island": None, "birth": 1, "fitness": 0.5},
    ]
    pq.write_table(
        table("population", rows), parquet_path(folder, "e", 0, "population")
    )
    tables, _ = read_tables(found_in(folder))
    assert tables["population"]["birth_island"].to_pylist() == [0, 0]


def test_without_semaphores_runs_are_measured_one_by_one(
    made: Maker, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """They lie in ``/dev/shm``, which cannot be written in some containers."""

    def no_semaphores(*_: object) -> None:
        raise OSError(errno.EROFS, "Read-only file system")

    monkeypatch.setattr("analysis.measures.study.ProcessPoolExecutor", no_semaphores)
    for number in range(4):
        made(f"run-{number}", seed=number)
    runs, _ = read_runs([tmp_path])
    assert [one.run for one in measure_runs(runs, processes=2)] == runs


@pytest.mark.slow
def test_several_processes_give_the_same_measures_as_one(
    made: Maker, tmp_path: Path
) -> None:
    for number in range(4):
        made(f"run-{number}", seed=number)
    runs, _ = read_runs([tmp_path])
    alone = [measure_run(run, "parent") for run in runs]
    together = list(measure_runs(runs, processes=2))
    assert [one.run for one in alone] == runs
    assert together == alone
