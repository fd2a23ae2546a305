"""Tests of ``revolve analyze`` on real runs."""

import json
import shutil
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.parquet as pq
import pytest
from msgspec.structs import replace
from PIL import Image

import revolve as rv
from analysis.figures.catalogue import FIGURES
from analysis.measures.outputs import OUTPUTS, schema
from schema.tables.description import description_text, read_description
from tests.system.workspace import Workspace

pytestmark = pytest.mark.system


@pytest.fixture(scope="session")
def report_and_output(
    once: Any,  # noqa: ANN401 - the fixture
    undisturbed: Path,
    crowded_arena_run: Path,
) -> tuple[Path, str]:
    """Return the measures of two off-line runs, an arena and two broken runs.

    The off-line runs have one name, and one setting is different.
    """

    def make(workspace: Workspace) -> None:
        for name, run in (
            ("a", undisturbed),
            ("b", crowded_arena_run),
            ("c", undisturbed),
        ):
            shutil.copytree(run, workspace.folder / "runs" / name)
        shutil.copytree(undisturbed, workspace.folder / "runs" / "e")
        other = workspace.folder / "runs" / "e"
        known = read_description(other)
        document = json.loads(known.document)
        document["vetting"]["tolerance_m"] = 0.001
        text = description_text(replace(known, document=json.dumps(document)))
        (other / "run.json").write_text(text)
        (workspace.folder / "runs" / "d").mkdir()
        (workspace.folder / "runs" / "d" / "run.json").write_text("{")
        output = workspace.run("analyze", "runs", "--out", "report")
        (workspace.folder / "output").write_text(output)

    folder: Path = once("analysed", make)
    return folder / "report", (folder / "output").read_text()


def test_runs_are_measured_and_left_out_runs_are_reported(
    report_and_output: tuple[Path, str],
) -> None:
    report, output = report_and_output
    measures = {path.stem: pq.read_table(path) for path in report.glob("*/*.parquet")}
    assert set(measures) == set(OUTPUTS) - {
        "between", "migrants", "named_measures", "sweeps", "learning",
        "learning_curves", "life_courses", "lifespans", "birth_places", "couples",
        "patch_means", "changes", "cells", "fronts",
    }  # fmt: skip
    for name, table in measures.items():
        assert table.schema.equals(schema(name), check_metadata=True)
    names = ["scenario1", "crowd", "scenario1~2"]
    assert measures["runs"]["experiment"].to_pylist() == names
    assert measures["runs"]["births"].to_pylist() == [60, 25, 60]
    for run in measures["runs"].to_pylist():
        assert run["function"] == "worker.fitness:thesis"
        assert run["failures"] >= 0
        assert 0 < run["duration_s"] < 300
    _check_later_windows(report.parent / "runs" / "a", measures)
    (arena,) = measures["interactions"].to_pylist()
    assert arena["robots"] == 25
    assert 0 < arena["touched"] <= 1
    assert {row["experiment"] for row in measures["variability"].to_pylist()} == {
        "crowd"
    }
    everything = measures["left_out"].to_pylist()
    named = [row for row in everything if row["folder"]]
    assert [(row["folder"], row["why"][:12]) for row in named] == [
        ("runs/d", "run.json: da"),
        ("runs/c", "the same run"),
    ]
    assert "left out: runs/d: run: run.json" in output


def _check_later_windows(folder: Path, measures: dict[str, pa.Table]) -> None:
    """Check what best robots sustain, one of each run, against evaluations here."""
    rows = measures["robots"].filter(pc.field("later_fitness").is_valid()).to_pylist()
    assert sorted(Path(row["folder"]).name for row in rows) == ["a", "b", "e"]
    (own,) = (row for row in rows if Path(row["folder"]).name == "a")
    run = rv.Run(folder)
    (best,) = run.best()
    assert best.origin is not None
    assert own["birth"] == best.origin.birth.number
    windows = [
        rv.evaluate(
            best, run.experiment.replace(simulation={"warmup_steps": 2400 * number})
        ).fitness
        or 0.0
        for number in range(5)
    ]
    later = sum(windows[1:]) / 4
    assert own["later_fitness"] == pytest.approx(later, rel=1e-12)
    assert own["sustained"] == pytest.approx(later / own["fitness"], rel=1e-12)
    ends = measures["outcomes"].filter(pc.field("folder") == own["folder"])
    assert ends["sustained"].to_pylist() == [own["sustained"]]


def test_experiments_of_the_same_name_get_distinct_names(
    report_and_output: tuple[Path, str],
) -> None:
    report, output = report_and_output
    differs = "vetting.tolerance_m: 0.001 instead of 1e-06"
    assert f"scenario1~2: {differs}" in output
    assert differs in (report / "report.html").read_text("utf-8")


def test_figures_are_written_or_left_out_with_a_reason(
    report_and_output: tuple[Path, str],
) -> None:
    report, output = report_and_output
    page = (report / "report.html").read_text("utf-8")
    drawn = {path.stem for path in (report / "figures").glob("*.png")}
    assert drawn == {path.stem for path in (report / "figures").glob("*.pdf")}
    stems = {one.number: one.stem for one in FIGURES}
    assert {stems[f"6.{n}"] for n in ("2", "3", "5a", "8", "9", "16")} <= drawn
    assert {f"figures/{name}.pdf" in page for name in drawn} == {True}
    with Image.open(report / "figures" / f"{stems['6.3']}.png") as picture:
        assert picture.info["dpi"] == pytest.approx((300, 300), abs=1)
    table = pq.read_table(report / "measures" / "left_out.parquet").to_pylist()
    why = {row["what"]: row["why"] for row in table if not row["folder"]}
    assert "revolve bench arena" in why["figure 6.1"]
    assert why["figure 6.19"] == (
        "no evaluated robot of scenario2 is in a recorded population"
    )
    assert "left out: figures " in output
    assert "B, D (no run has several islands)" in " ".join(output.split())
    missing = {n for n, stem in stems.items() if stem not in drawn}
    assert {f"figure {n}" for n in missing} <= set(why)
    assert not {f"figure {n}" for n in set(stems) - missing} & set(why)


def test_fonts_are_embedded_in_pdfs(report_and_output: tuple[Path, str]) -> None:
    report, _ = report_and_output
    pdfs = [path.read_bytes() for path in (report / "figures").glob("6.*.pdf")]
    # Type 42 is TrueType: its outlines are in FontFile2, and text stays text.
    assert {b"/FontFile2" in pdf and b"/Type3" not in pdf for pdf in pdfs} == {True}
