"""Docstrings of own measures, from the sources that a run keeps."""

from pathlib import Path

import pyarrow as pa
import pytest

from analysis.measures.load import LoadedRun
from analysis.measures.named_measures import with_docstrings
from schema.experiment.document import Experiment, Measures

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
def run(tmp_path: Path) -> LoadedRun:
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


def described(run: LoadedRun, *names: str) -> dict[str, str]:
    rows = with_docstrings(pa.table({"measure": list(names)}), run).to_pylist()
    return {row["measure"]: row["about"] for row in rows}


def test_first_lines_of_docstrings(run: LoadedRun) -> None:
    assert described(run, *NAMES) == {
        "flight": "Return the share of samples in the air [1].",
        "speed": "Greatest speed <b>[m/s]</b>.",
        "bare": "",
        "gone": "",
    }


def test_modules_of_a_package(run: LoadedRun) -> None:
    found = described(run_of(run.folder, ["lab.ropes:flight"]), "flight", "turning")
    assert found == {
        "flight": "Return the share of samples in the air [1].",
        "turning": "",
    }


def test_sources_that_cannot_be_read_give_nothing(run: LoadedRun) -> None:
    assert described(run, "none", "far") == {"none": "", "far": ""}


@pytest.mark.parametrize("name", ["{0}/plugins/gaits:flight", ":flight", "a..b:flight"])
def test_only_modules_of_the_run_are_read(run: LoadedRun, name: str) -> None:
    """A run folder may be somebody else's."""
    hostile = run_of(run.folder / "other", [name.format(run.folder)])
    assert described(hostile, "flight") == {"flight": ""}
