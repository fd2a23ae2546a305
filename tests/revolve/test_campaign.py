"""Tables over all runs of a folder, and their export, against other readers."""

import base64
import json
import re
import shutil
from pathlib import Path
from typing import Any

import duckdb
import numpy as np
import polars as pl
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

import revolve as rv
from revolve.cli.export import main
from schema.tables.columns import TABLES
from tests.analysis.campaign import random_bodies, write_run

BIRTHS = 60
NAMED = ("experiment", "repeat", "seed")


@pytest.fixture(scope="module")
def campaign(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder of two finished repeats of two experiments and of an arena."""
    folder = tmp_path_factory.mktemp("campaign")
    bodies = pa.array(random_bodies(np.random.default_rng(1), BIRTHS))
    for name in ("scenario1", "no-selection", "scenario3"):
        for number in range(2):
            place = folder / f"{name}-{number}"
            write_run(place, name, number, BIRTHS - number, bodies)
    return folder


def export(*words: object) -> None:
    assert main(["export", *map(str, words)]) == 0


@pytest.mark.parametrize("name", TABLES)
def test_table_has_the_rows_of_all_runs(campaign: Path, name: str) -> None:
    runs = rv.read(campaign)
    assert isinstance(runs, rv.Runs)
    assert [run.folder.name for run in runs] == sorted(
        each.name for each in campaign.iterdir()
    )
    table = runs.table(name)
    assert name == "archive" or getattr(runs, name).equals(table)
    assert table.schema.names[: len(TABLES[name])] == TABLES[name].names
    assert set(NAMED) < set(table.schema.names)
    first = 0
    for run in runs:
        own = run.table(name)
        rows = table.slice(first, own.num_rows)
        assert rows.select(own.schema.names).equals(own)
        known = (run.name, run.number, run.seed)
        for column, value in zip(NAMED, known, strict=True):
            assert rows[column].to_pylist() == [value] * own.num_rows
        first += own.num_rows
    assert first == table.num_rows


def test_rows_are_those_that_duckdb_counts(campaign: Path) -> None:
    files = [str(file) for file in campaign.glob("**/births.parquet")]
    relation = duckdb.read_parquet(files, hive_partitioning=True)
    counted = "experiment, run, count(*)"
    theirs = sorted(relation.aggregate(counted, "experiment, run").fetchall())
    table = rv.read(campaign).births.group_by(["experiment", "repeat"])
    ours = table.aggregate([("birth", "count")]).to_pylist()
    assert sorted(tuple(row.values()) for row in ours) == theirs
    assert len(theirs) == 6


def test_single_runs_copies_and_unreadable_folders(
    campaign: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    one = shutil.copytree(campaign / "scenario1-0", tmp_path / "a")
    assert isinstance(rv.read(one), rv.Run)
    shutil.copytree(one, tmp_path / "b")
    (tmp_path / "c").mkdir()
    (tmp_path / "c" / "run.json").write_text("{")
    runs = rv.read(tmp_path)
    said = capsys.readouterr().err
    assert runs.births.num_rows == BIRTHS
    assert re.search(r"left out: \S+/b: the same run as \S+/a\n", said)
    assert re.search(r"left out: \S+/c: .*damaged", said)


@pytest.mark.parametrize(
    ("given", "line"),
    [
        ("gone", "gone: no such folder"),
        ("empty", "empty: no run in or below this folder"),
        ("file", "file: must be a folder, got a file"),
        ("torn", "torn/run.json: damaged: "),
        ("several", "no run can be read: several/torn: run.json: damaged: "),
        ("loop", "loop/run.json: cannot be read: Too many levels of symbolic links"),
        ("x" * 300, "/run.json: cannot be read: File name too long"),
        ("", "folder: must be the path of a run, got ''"),
        (3, "folder: must be the path of a run, got 3"),
        (["a", "b"], "folder: must be the path of a run, got ['a', 'b']"),
    ],
)
def test_each_mistake_in_what_is_read_is_one_line(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    given: Any,  # noqa: ANN401 - wrong types
    line: str,
) -> None:
    monkeypatch.chdir(tmp_path)
    for torn in (Path("torn"), Path("several", "torn")):
        torn.mkdir(parents=True)
        (torn / "run.json").write_text("{")
    Path("empty").mkdir()
    Path("file").touch()
    Path("loop").symlink_to("loop")
    with pytest.raises(rv.RevolveError) as caught:
        rv.read(given)
    assert line in str(caught.value)
    assert "\n" not in str(caught.value)


def test_csv_is_read_by_others(campaign: Path, tmp_path: Path) -> None:
    file = tmp_path / "births.csv"
    export(campaign, "--to", "csv", "--out", file)
    births = rv.read(campaign).births
    frame = pl.read_csv(file, infer_schema_length=None)
    for name in ("island", "birth", "rank", "parts", "sim_time_s", *NAMED):
        assert frame[name].to_list() == births[name].to_pylist(), name
    parents = [json.loads(each) for each in frame["parents"]]
    assert parents == births["parents"].to_pylist()
    genomes = [base64.b64decode(each) for each in frame["genome"]]
    assert genomes == births["genome"].to_pylist()
    assert len(duckdb.read_csv(str(file)).fetchall()) == births.num_rows


def test_measures_of_csv_are_json(tmp_path: Path, campaign: Path) -> None:
    place = tmp_path / "runs" / "a"
    shutil.copytree(campaign / "scenario1-0", place)
    (file,) = place.glob("**/evaluations.parquet")
    table = pq.read_table(file, partitioning=None)
    number = table.schema.get_field_index("measures")
    cells = [[("energy", 1.5)], None] * (BIRTHS // 2)
    kind = TABLES["evaluations"].field("measures").type
    pq.write_table(table.set_column(number, "measures", pa.array(cells, kind)), file)
    out = tmp_path / "evaluations.csv"
    export(place, "--table", "evaluations", "--to", "csv", "--out", out)
    assert pl.read_csv(out)["measures"].to_list()[:2] == ['{"energy":1.5}', None]


@pytest.mark.parametrize("to", ["parquet", "phylogeny"])
def test_other_formats_hold_the_tables(
    campaign: Path, tmp_path: Path, to: str, capsys: pytest.CaptureFixture[str]
) -> None:
    runs, file = rv.Runs(campaign), tmp_path / "file"
    export(campaign, "--to", to, "--out", file)
    if to == "parquet":
        assert pq.read_table(file).equals(runs.births)
    else:
        frame, rows = pl.read_csv(file), runs.phylogeny()
        assert frame.columns == rows.schema.names
        for name in ("id", "ancestor_list", "destruction_time", "repeat"):
            assert frame[name].to_list() == rows[name].to_pylist()
        assert frame["id"].to_list() == list(range(len(frame)))
    assert capsys.readouterr().out == f"{file}: {runs.births.num_rows} rows of 6 runs\n"


def test_export_of_an_empty_table_names_those_with_rows(
    campaign: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / "file"
    export(campaign, "--table", "drifts", "--to", "csv", "--out", file)
    told, _, full = capsys.readouterr().out.strip().partition("; tables with rows: ")
    assert told == f"{file}: 0 rows of 6 runs"
    runs = rv.Runs(campaign)
    assert full.split(", ") == [each for each in TABLES if runs.table(each).num_rows]


@pytest.mark.system
def test_latex_is_the_comparison_of_the_report(campaign: Path, tmp_path: Path) -> None:
    rv.Runs(campaign).export(tmp_path / "a.tex", to="latex")
    text = (tmp_path / "a.tex").read_text()
    analysis = rv.analyze(campaign, out=tmp_path / "report", figures=["6.3"])
    rows = analysis.table("comparison").to_pylist()
    tested = [row for row in rows if row["p"] is not None]
    # Lines of measures, and of the heads of the pairs of experiments.
    assert text.count(r" \\") == len(tested) + len({(r["a"], r["b"]) for r in rows})
    row = next(row for row in tested if row["measure"] == "diversity")
    means = (f"${row[name]:.3g}$" for name in ("mean_a", "mean_b", "difference"))
    assert f"diversity & {' & '.join(means)} & [" in text


@pytest.mark.parametrize(
    ("words", "line"),
    [
        (["{0}/none", "--to", "csv"], r"none: no such folder"),
        (["{1}", "--to", "csv"], r"no run in or below this folder"),
        (
            ["{0}", "--to", "csv", "--table", "birth"],
            r"--table: must be one of .*; did you mean 'births'",
        ),
        (["{0}", "--to", "xlsx"], r"--to: must be one of csv, .*got 'xlsx'"),
        (["{0}"], r"required: --to"),
        (["--to", "csv"], r"required: FOLDER"),
        (
            ["{0}", "--to", "latex", "--table", "births"],
            r"--table: is for --to csv",
        ),
        (["{0}", "--to", "phylogeny", "--table", "births"], r"not phylogeny"),
        (["{0}", "{0}", "--to", "csv"], r"unexpected argument"),
        (
            ["{0}/scenario1-0", "--to", "latex"],
            r"two experiments .* scenario1$",
        ),
        (["{2}", "--to", "csv"], r"births\.parquet: cannot be read"),
    ],
)
def test_mistakes_are_one_line_and_nothing_is_written(
    campaign: Path,
    tmp_path: Path,
    words: list[str],
    line: str,
    capsys: pytest.CaptureFixture[str],
) -> None:
    broken = shutil.copytree(campaign / "scenario1-1", tmp_path / "broken")
    (file,) = broken.glob("**/births.parquet")
    file.write_bytes(file.read_bytes()[:-9])
    (tmp_path / "empty").mkdir()
    out = tmp_path / "out"
    given = [each.format(campaign, tmp_path / "empty", broken) for each in words]
    with pytest.raises((rv.RevolveError, SystemExit)) as caught:
        export(*given, "--out", out)
    said = capsys.readouterr().err or str(caught.value)
    assert re.search(line, said.strip())
    assert said.strip().count("\n") == 0
    assert not out.exists()


def test_unwritable_files_and_unknown_tables_are_refused(
    campaign: Path, tmp_path: Path
) -> None:
    wrong: Any = 3
    with pytest.raises(rv.RunFolderError, match="cannot be written: No such file"):
        export(campaign, "--to", "csv", "--out", tmp_path / "no" / "a.csv")
    with pytest.raises(rv.RunFolderError, match="no table 'birth'; did you mean"):
        rv.Runs(campaign).table("birth")
    with pytest.raises(rv.RunFolderError, match="no table 3; tables: births, "):
        rv.Runs(campaign).table(wrong)
