"""Output of ``revolve analyze``: summary, progress, and what cannot be drawn."""

import io
from pathlib import Path
from threading import Event
from typing import Any, NoReturn

import numpy as np
import pyarrow as pa
import pytest
from rich.console import Console

from analysis.__main__ import parser
from analysis.analyze_command import analyze
from analysis.measures.outputs import schema
from analysis.progress import bars
from analysis.render.files import NoPictures
from analysis.summary import show
from schema.errors import RevolveError
from schema.tables.columns import TABLES
from schema.tables.files import parquet_path
from tests.analysis.campaign import random_bodies, write_run
from worker.robot.evaluation import evaluate


def no_pictures() -> NoReturn:
    raise NoPictures("nothing draws here")


def test_an_analysis_without_figures_says_so(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    kind = TABLES["births"].field("body").type
    bodies = pa.array(random_bodies(np.random.default_rng(1), 30), kind)
    write_run(tmp_path / "run", "scenario1", 0, 30, bodies)
    parquet_path(tmp_path / "run", "scenario1", 0, "births").unlink()
    out = tmp_path / "report"
    options = parser("analyze").parse_args(
        [str(tmp_path / "run"), "--out", str(out), "--processes", "1"]
    )
    assert analyze(options, ["analyze", "run"], no_pictures, evaluate) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[0] == "no population could be measured"
    text = "no figure could be drawn; see the line 'left out: figures'"
    assert f"{out / 'figures'}: {text}" in lines
    (line,) = [line for line in lines if line.startswith("left out: figures ")]
    assert "; 6.2, " in line
    assert line.count("no finished run could be measured") == 1
    analyze(options, ["analyze", "run"], no_pictures, evaluate)
    first = capsys.readouterr().out.splitlines()[0]
    assert first.startswith(f"{out / 'report.html'}: replaces the report of ")


@pytest.mark.parametrize(
    ("flags", "text"),
    [
        (["--figures", "6.3,Z"], r"--figures: must be of 6\.1, .*, S, got 'Z'$"),
        (["--colours", "blurple"], "--colours: must be colours, or a colour map, of"),
    ],
)
def test_names_that_do_not_exist_are_refused_before_anything_is_written(
    tmp_path: Path, flags: list[str], text: str
) -> None:
    kind = TABLES["births"].field("body").type
    bodies = pa.array(random_bodies(np.random.default_rng(1), 30), kind)
    write_run(tmp_path / "run", "scenario1", 0, 30, bodies)
    words = [str(tmp_path / "run"), "--out", str(tmp_path / "report"), *flags]
    with pytest.raises(RevolveError, match=text):
        analyze(parser("analyze").parse_args(words), words, no_pictures, evaluate)
    assert not (tmp_path / "report").exists()


def test_only_the_figures_asked_for_are_drawn(tmp_path: Path) -> None:
    kind = TABLES["births"].field("body").type
    bodies = pa.array(random_bodies(np.random.default_rng(1), 30), kind)
    write_run(tmp_path / "run", "scenario1", 0, 30, bodies)
    out = tmp_path / "report"
    (out / "figures").mkdir(parents=True)
    kept = out / "figures" / "6.9-parts-at-the-end.png"
    kept.touch()
    words = [str(tmp_path / "run"), "--out", str(out), "--processes", "1"]
    words += ["--figures", "6.3,6.14a", "--format", "svg", "--style", "dark"]
    analyze(parser("analyze").parse_args(words), words, no_pictures, evaluate)
    assert sorted((out / "figures").iterdir()) == [
        out / "figures" / "6.14a-fitness-by-the-number-of-extremities.svg",
        out / "figures" / "6.14a-fitness-by-the-number-of-extremities.txt",
        out / "figures" / "6.3-fitness-over-births.svg",
        out / "figures" / "6.3-fitness-over-births.txt",
        kept,
    ]
    page = (out / "report.html").read_text("utf-8")
    assert "--paper: #171717;" in page
    assert "figures/6.3-fitness-over-births.svg" in page
    assert "figure 6.2" not in page


NAME = "archipelago-of-many-islands"
ROWS: dict[str, list[dict[str, Any]]] = {
    "populations": [
        {"experiment": NAME, "folder": f"runs/{NAME}-12", "island": 3,
         "births": births, "judged": 15, "fitness": 0.1234, "fitness_best": 0.5678}
        for births in (30, 1500)
    ],
    "robots": [{"experiment": NAME, "folder": f"runs/{NAME}-12", "island": 3,
                "sustained": 0.3456}],
    "findings": [
        {"figure": "6.14", "claim": f"{NAME}: more [bold] extremities", "runs_a": 2,
         "mean_a": -0.369, "mean_b": 0.5, "q": 0.701, "verdict": "not reproduced"},
    ],
    "runs": [{"experiment": NAME, "differs": "births: 1 instead of 2"}],
    "left_out": [{"folder": "runs/x", "what": "run", "why": "broken [red] & gone"}],
}  # fmt: skip


def output(rows: dict[str, list[dict[str, Any]]], width: int) -> str:
    tables = {
        name: pa.Table.from_pylist(rows.get(name, []), schema(name)) for name in ROWS
    }
    out = io.StringIO()
    show(tables, Console(file=out, width=width))
    return out.getvalue()


@pytest.mark.parametrize("width", [10, 40, 60, 70, 80, 120])
def test_nothing_is_cut_off_on_a_narrow_console(width: int) -> None:
    text = output(ROWS, width)
    assert "…" not in text
    for number in (
        "1500",
        "15",
        "0.1234",
        "0.5678",
        "35",
        "6.14",
        "-0.369",
        "0.5",
        "0.701",
    ):
        assert number in text.replace("│", " ").replace(",", " ").split()
    words = "".join(text.replace("│", " ").split())
    for cell in ("[bold]", "reproduced", "instead", "[red]"):
        assert cell in words


def test_folded_names_are_complete() -> None:
    lines = output({"populations": ROWS["populations"]}, 92).splitlines()
    cells = [line.split("│")[1:3] for line in lines if line.startswith("│")]
    assert "".join(name.strip() for name, _ in cells) == NAME
    assert "".join(run.strip() for _, run in cells).replace(" ", "") == f"{NAME}-123"


def test_all_islands_of_a_run_are_named_if_it_has_several() -> None:
    (row, _) = ROWS["populations"]
    places = [("runs/arch", 0), ("runs/arch", 1), ("runs/alone", 0)]
    rows = [row | {"folder": folder, "island": island} for folder, island in places]
    lines = output({"populations": rows}, 120).splitlines()
    runs = [line.split("│")[2].strip() for line in lines if line.startswith("│")]
    assert runs == ["alone", "arch 0", "arch 1"]


def test_figures_that_are_left_out_share_a_line() -> None:
    rows = [
        {"folder": "", "what": f"figure {number}", "why": why}
        for number, why in (("6.1", "no file"), ("B", "one island"), ("7.1", "no file"))
    ]
    assert output({"left_out": [*ROWS["left_out"], *rows]}, 80).splitlines()[1:] == [
        "left out: runs/x: run: broken [red] & gone",
        "left out: figures 6.1, 7.1 (no file); B (one island)",
    ]


def test_different_fitness_functions_are_named() -> None:
    rows = [
        {"experiment": name, "differs": "", "fitness_function": text}
        for name, text in (("a", "locomotion"), ("b", "x:f"), ("c", "x:f"))
    ]
    assert "compared" not in output({"runs": rows[1:]}, 80)
    text = output({"runs": rows}, 200)
    assert "fitness is not compared between different fitness functions" in text
    assert ": a by locomotion; b, c by x:f\n" in text


@pytest.fixture
def lines(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Return the list that gets the lines of a log, which come quickly."""
    found: list[str] = []
    monkeypatch.setattr("analysis.progress.SPAN_S", 0.01)
    monkeypatch.setattr(
        "analysis.progress.print_line", lambda _console, line: found.append(line)
    )
    return found


def wait_for(line: str, lines: list[str]) -> None:
    """Wait for a line; ended by the test's time limit if it does not come."""
    while line not in lines:
        Event().wait(0.01)


def test_a_log_shows_how_far_unfinished_tasks_are(lines: list[str]) -> None:
    with bars("three things") as bar:
        bar.update(bar.add_task("done", total=2), completed=2)
        bar.update(bar.add_task("things [bold]", total=3), completed=2)
        bar.add_task("comparing", total=None)
        bar.update(bar.add_task("steps", total=1.0), completed=0.247)
        tracked = iter(bar.track(["first", "second"], description="tracked"))
        assert [next(tracked), next(tracked)] == ["first", "second"]
        assert lines[0] == "three things"
        wait_for(
            "things [bold]: 2 of 3; comparing; steps: 25 %; tracked: 1 of 2", lines
        )


def test_a_log_repeats_no_line_while_nothing_moves(lines: list[str]) -> None:
    with bars("two robots") as bar:
        task = bar.add_task("rendering", total=2)
        wait_for("rendering: 0 of 2", lines)
        Event().wait(0.2)  # of many lines, if they were repeated
        bar.update(task, completed=1)
        wait_for("rendering: 1 of 2", lines)
    assert lines == ["two robots", "rendering: 0 of 2", "rendering: 1 of 2"]
