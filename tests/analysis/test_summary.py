"""Tests of the summary of an analysis, on consoles of any width."""

import io
from typing import Any

import pyarrow as pa
import pytest
from rich.console import Console

from analysis.measures.outputs import schema
from analysis.summary import show

NAME = "archipelago-of-many-islands"
ROWS: dict[str, list[dict[str, Any]]] = {
    "populations": [
        {"experiment": NAME, "folder": f"runs/{NAME}-12", "island": 3,
         "births": births, "judged": 15, "fitness": 0.1234, "fitness_best": 0.5678}
        for births in (30, 1500)
    ],
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
    for number in ("1500", "15", "0.1234", "0.5678", "6.14", "-0.369", "0.5", "0.701"):
        assert number in text.replace("│", " ").replace(",", " ").split()
    words = "".join(text.replace("│", " ").split())
    for cell in ("[bold]", "reproduced", "instead", "[red]"):
        assert cell in words


def test_folded_names_are_complete() -> None:
    lines = output({"populations": ROWS["populations"]}, 80).splitlines()
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
