"""Means of named measures, worked out by hand; docstrings of own ones."""

from pathlib import Path
from typing import Any

import pyarrow as pa
import pytest

from analysis.figures.catalogue import FIGURES
from analysis.figures.forms import NothingToDraw
from analysis.measures.load import LoadedRun
from analysis.measures.named_measures import named_measures, with_docstrings
from analysis.measures.run_tables import RunTables
from schema.experiment.document import Experiment, Measures
from tests.analysis.tables import births, population, run, table

BORN = births(((0, 0), []), ((0, 1), []), ((0, 2), []))


def evaluations(*rows: tuple[int, int, int, dict[str, float]]) -> pa.Table:
    """Return rows of island, birth on island 0, trial, and measures."""
    names = ("island", "birth", "trial", "birth_island", "measures")
    values = [(*place, 0, [*measures.items()] or None) for *place, measures in rows]
    made = [dict(zip(names, row, strict=True)) for row in values]
    return table("evaluations", made)


def named(tables: dict[str, pa.Table]) -> list[tuple[Any, ...]]:
    """Return island, births, measure, mean and robots of each row."""
    return [
        tuple(row.values()) for row in named_measures(RunTables(tables)).to_pylist()
    ]


def test_off_line_each_robot_counts_with_its_last_evaluation() -> None:
    tables = run(
        births=BORN,
        population=population(
            (0, 2, {(0, 0): 0.5, (0, 1): 0.25}), (0, 3, {(0, 1): 0.25, (0, 2): None})
        ),
        evaluations=evaluations(
            (0, 0, 0, {"height": 1.0, "turning": 4.0}),
            (0, 1, 0, {"height": 3.0, "turning": 5.0}),
            (0, 2, 0, {}),
            (0, 1, 1, {"height": 5.0, "turning": 7.0}),
        ),
    )
    assert named(tables) == [
        (0, 2, "height", 3.0, 2),
        (0, 2, "turning", 5.5, 2),
        (0, 3, "height", 5.0, 1),
        (0, 3, "turning", 7.0, 1),
    ]


def test_each_island_judges_a_migrant_by_its_own_evaluation() -> None:
    """Robots 0 and 1 of island 0; robot 1 went to island 1."""
    one, migrant = (0, 0), (0, 1)
    tables = run(
        births=births((one, []), (migrant, [])),
        population=population((0, 1, {one: 0.5, migrant: 0.5}), (1, 1, {migrant: 0.2})),
        evaluations=evaluations(
            (0, 0, 0, {"height": 1.0}),
            (0, 1, 0, {"height": 5.0}),
            (1, 1, 0, {"height": 4.0}),
        ),
    )
    assert named(tables) == [(0, 1, "height", 3.0, 2), (1, 1, "height", 4.0, 1)]


def test_on_line_the_samples_of_mature_robots_count() -> None:
    samples = [
        {"birth": birth, "births": count, "is_mature": height != 9.0,
         "measures": height and [("height", height)]}
        for birth, count, height in (
            (0, 2, 1.0), (1, 2, 9.0), (0, 2, 2.0), (1, 2, 6.0), (2, 3, None),
            (1, 3, 4.0),
        )
    ]  # fmt: skip
    tables = run(
        births=BORN,
        population=population((0, 2, {(0, 0): 0.5, (0, 1): 0.25}), is_online=True),
        fitness=table("fitness", samples),
    )
    assert named(tables) == [(0, 2, "height", 3.0, 2), (0, 3, "height", 4.0, 1)]


def test_run_without_measures_has_no_rows_and_no_figure() -> None:
    tables = run(births=BORN, population=population((0, 1, {(0, 0): 0.5})))
    found = named_measures(RunTables(tables))
    assert found.num_rows == 0
    (figure,) = (each for each in FIGURES if each.number == "H")
    with pytest.raises(NothingToDraw, match="no experiment names measures"):
        figure.drawn({"named_measures": found})


SOURCE = '''\
"""Measures of a lab; importing it would fail."""
import no_such_module

def flight(trace):
    """Return the share of samples in the air [1].

    Not of those before the window.
    """

def speed(trace):
    "Greatest speed <b>[m/s]</b>."

def bare(trace):
    return 0.0
'''
NAMES = ("flight", "speed", "bare", "gone")


@pytest.fixture
def lab(tmp_path: Path) -> LoadedRun:
    (tmp_path / "plugins" / "lab").mkdir(parents=True)
    (tmp_path / "plugins" / "gaits.py").write_text(SOURCE)
    (tmp_path / "plugins" / "lab" / "ropes.py").write_text(SOURCE)
    (tmp_path / "plugins" / "broken.py").write_text("def )(")
    names = [f"gaits:{name}" for name in NAMES]
    names += ["height", "broken:none", "installed:far"]
    return run_of(tmp_path, names)


def run_of(folder: Path, names: list[str]) -> LoadedRun:
    settings = Experiment("a", measures=Measures(names=tuple(names)))
    return LoadedRun(folder, "a", 0, 1, "finished", "{}", settings)


def described(lab: LoadedRun, *names: str) -> dict[str, str]:
    rows = with_docstrings(pa.table({"measure": list(names)}), lab).to_pylist()
    return {row["measure"]: row["about"] for row in rows}


def test_first_lines_of_docstrings(lab: LoadedRun) -> None:
    assert described(lab, *NAMES) == {
        "flight": "Return the share of samples in the air [1].",
        "speed": "Greatest speed <b>[m/s]</b>.",
        "bare": "",
        "gone": "",
    }


def test_modules_of_a_package(lab: LoadedRun) -> None:
    found = described(run_of(lab.folder, ["lab.ropes:flight"]), "flight", "turning")
    assert found == {
        "flight": "Return the share of samples in the air [1].",
        "turning": "",
    }


def test_sources_that_cannot_be_read_give_nothing(lab: LoadedRun) -> None:
    assert described(lab, "none", "far") == {"none": "", "far": ""}


@pytest.mark.parametrize("name", ["{0}/plugins/gaits:flight", ":flight", "a..b:flight"])
def test_only_modules_of_the_run_are_read(lab: LoadedRun, name: str) -> None:
    """A run folder may be somebody else's."""
    hostile = run_of(lab.folder / "other", [name.format(lab.folder)])
    assert described(hostile, "flight") == {"flight": ""}
