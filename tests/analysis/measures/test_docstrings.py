"""Units and meanings of own measures, from the sources that a run keeps."""

import json
from pathlib import Path

import pyarrow as pa
import pytest

from analysis.measures import docstrings
from analysis.measures.docstrings import with_meanings
from analysis.measures.load import IslandSettings, Run
from worker.measures.functions import BUILT_IN

SOURCE = '''\
"""Measures of a lab; importing it would fail."""
import no_such_module

def flight(trace):
    """Return the share of samples in the air [1].

    Not of those before the window.
    """

def speed(trace):
    "Greatest speed <b>[m/s]</b>."

def pull(trace):
    """Return the pull of a rope [N m] of 3 [kg]"""

def bare(trace):
    return 0.0
'''
NAMES = ("flight", "speed", "pull", "bare", "gone")


@pytest.fixture
def run(tmp_path: Path) -> Run:
    (tmp_path / "plugins" / "lab").mkdir(parents=True)
    (tmp_path / "plugins" / "gaits.py").write_text(SOURCE)
    (tmp_path / "plugins" / "lab" / "ropes.py").write_text(SOURCE)
    (tmp_path / "plugins" / "broken.py").write_text("def )(")
    names = [f"gaits:{name}" for name in NAMES]
    names += ["height", "lab.ropes:pull_", "broken:none", "installed:far"]
    document = json.dumps({"measures": {"names": names}})
    islands = (IslandSettings(30, is_online=False, records_touches=False),)
    return Run(tmp_path, "a", 0, 1, "finished", document, islands)


def described(run: Run, *names: str) -> dict[str, tuple[str, str]]:
    rows = with_meanings(pa.table({"measure": list(names)}), run).to_pylist()
    return {row["measure"]: (row["unit"], row["about"]) for row in rows}


def test_first_lines_of_docstrings_and_units_in_them(run: Run) -> None:
    assert described(run, *NAMES) == {
        "flight": ("1", "Return the share of samples in the air [1]."),
        "speed": ("", "Greatest speed <b>[m/s]</b>."),
        "pull": ("kg", "Return the pull of a rope [N m] of 3 [kg]"),
        "bare": ("", ""),
        "gone": ("", ""),
    }


def test_modules_of_a_package(run: Run) -> None:
    document = json.dumps({"measures": {"names": ["lab.ropes:flight"]}})
    ((unit, about),) = described(
        Run(run.folder, "a", 0, 1, "finished", document, run.islands), "flight"
    ).values()
    assert (unit, about[:16]) == ("1", "Return the share")


def test_sources_that_cannot_be_read_give_nothing(run: Run) -> None:
    assert described(run, "none", "far") == {"none": ("", ""), "far": ("", "")}


def test_units_of_built_in_measures_are_those_of_their_docstrings(run: Run) -> None:
    assert docstrings._UNITS.keys() == BUILT_IN.keys()
    for name, function in BUILT_IN.items():
        ((unit, about),) = described(run, name).values()
        assert f"[{unit}]" in (function.__doc__ or "").partition("Source")[0], name
        assert about == ""
