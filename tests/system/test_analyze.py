"""``revolve analyze`` as a user starts it, on runs that were really made."""

import json
import shutil
from pathlib import Path
from typing import Any

import duckdb
import polars as pl
import pyarrow.parquet as pq
import pytest

from analysis.figures.catalogue import FIGURES
from analysis.measures.outputs import OUTPUTS, schema
from tests.system.stage import Stage

pytestmark = [pytest.mark.system, pytest.mark.timeout(300)]


@pytest.fixture(scope="session")
def analysed(once: Any, undisturbed: Path, calm: Path) -> tuple[Path, str]:  # noqa: ANN401 - the fixture
    """Return the measures of two off-line runs, an arena and two broken runs.

    The off-line runs have one name, and one setting is different.
    """

    def make(stage: Stage) -> None:
        for name, run in (("a", undisturbed), ("b", calm), ("c", undisturbed)):
            shutil.copytree(run, stage.folder / "runs" / name)
        shutil.copytree(undisturbed, stage.folder / "runs" / "e")
        details = stage.folder / "runs" / "e" / "run.json"
        entries = json.loads(details.read_text())
        document = json.loads(entries["document"])
        document["vetting"]["tolerance_m"] = 0.001
        details.write_text(json.dumps({**entries, "document": json.dumps(document)}))
        (stage.folder / "runs" / "d").mkdir()
        (stage.folder / "runs" / "d" / "run.json").write_text("{")
        told = stage.run("analyze", "runs", "--out", "report")
        (stage.folder / "told").write_text(told)

    folder: Path = once("analysed", make)
    return folder / "report", (folder / "told").read_text()


def test_runs_are_measured_and_what_is_left_out_is_named(
    analysed: tuple[Path, str],
) -> None:
    report, told = analysed
    measures = {path.stem: pq.read_table(path) for path in report.glob("*/*.parquet")}
    assert set(measures) == set(OUTPUTS) - {"between", "migrants"}
    for name, table in measures.items():
        assert table.schema.equals(schema(name), check_metadata=True)
    names = ["scenario1", "crowd", "scenario1~2"]
    assert measures["runs"]["experiment"].to_pylist() == names
    assert measures["runs"]["births"].to_pylist() == [60, 25, 60]
    (arena,) = measures["interactions"].to_pylist()
    assert arena["robots"] == 25
    assert 0 < arena["touched"] <= 1
    assert {row["experiment"] for row in measures["variability"].to_pylist()} == {
        "crowd"
    }
    everything = measures["left_out"].to_pylist()
    named = [row for row in everything if row["folder"]]
    assert [(row["folder"], row["why"][:12]) for row in named] == [
        ("runs/d", "run.json: ca"),
        ("runs/c", "the same run"),
    ]
    assert "left out: runs/d: run: run.json" in told


def test_experiments_of_one_name_are_told_apart(analysed: tuple[Path, str]) -> None:
    report, told = analysed
    differs = "vetting.tolerance_m: 0.001 instead of 1e-06"
    assert f"scenario1~2: {differs}" in told
    assert differs in (report / "report.html").read_text("utf-8")


def test_figures_and_report_are_written_and_what_is_left_out_has_a_reason(
    analysed: tuple[Path, str],
) -> None:
    report, told = analysed
    page = (report / "report.html").read_text("utf-8")
    drawn = {path.stem for path in (report / "figures").glob("*.png")}
    assert drawn == {path.stem for path in (report / "figures").glob("*.pdf")}
    assert {f"figure-6.{n}" for n in ("2", "3", "5a", "8", "9", "16")} <= drawn
    assert {f'<figure id="{name}">' in page for name in drawn} == {True}
    table = pq.read_table(report / "measures" / "left_out.parquet").to_pylist()
    why = {row["what"]: row["why"] for row in table if not row["folder"]}
    assert "revolve bench arena" in why["figure 6.1"]
    assert why["figure 6.19"] == "no robot of scenario2 was judged"
    assert "left out: figure B: no run has several islands" in told
    everything = {f"figure-{one.number}" for one in FIGURES}
    assert everything == (everything & drawn) | {
        name.replace(" ", "-") for name in why if name.replace(" ", "-") in everything
    }


def test_three_readers_read_the_same(analysed: tuple[Path, str]) -> None:
    report, _ = analysed
    for path in sorted(report.glob("measures/*.parquet")):
        arrow = pq.read_table(path)
        assert pl.read_parquet(path).rows() == [
            tuple(row.values()) for row in arrow.to_pylist()
        ]
        rows = duckdb.read_parquet(str(path)).fetchall()
        assert rows == [tuple(row.values()) for row in arrow.to_pylist()]


def test_no_run_is_one_line(stage: Stage) -> None:
    told = stage.run("analyze", "nowhere", code=2)
    assert told == "revolve: nowhere: no such folder\n"


def test_a_file_is_no_place_for_a_report(stage: Stage, undisturbed: Path) -> None:
    (stage.folder / "file").write_text("mine")
    told = stage.run("analyze", str(undisturbed), "--out", "file", code=2)
    assert told == "revolve: file: cannot be written: Not a directory\n"
    assert (stage.folder / "file").read_text() == "mine"


def test_a_single_run_that_is_broken_in_part_is_measured_as_far_as_it_goes(
    stage: Stage, undisturbed: Path
) -> None:
    shutil.copytree(undisturbed, stage.folder / "run")
    (evaluations,) = (stage.folder / "run").glob("tables/*/*/evaluations.parquet")
    evaluations.write_bytes(b"")
    told = stage.run("analyze", "run", "--out", "report")
    assert "left out: run: table evaluations: " in told
    robots = pq.read_table(stage.folder / "report" / "measures" / "robots.parquet")
    assert robots.num_rows == 0
