"""Runs that start from robots of other runs and of files."""

import json
import shutil
from operator import itemgetter
from pathlib import Path
from typing import Any

import pytest
from msgspec.structs import replace

import revolve as rv
from coordinator.run.history import arena_history
from coordinator.storage.compare import compare
from revolve.command import main
from schema.experiment.document import UNNAMED
from schema.plugins.kept import KeptPlugin
from schema.tables.description import description_text, read_description
from schema.tables.files import read_table
from tests.system.documents import MIXED
from tests.system.fleet import kill_beyond, size
from tests.system.workspace import Workspace

pytestmark = pytest.mark.system

GIVEN = """
[founders]
run = "source"
population = "best"
repeat = true
"""
SHORT = """
name = "short"
births = 12
[selection]
population = 6
[simulation]
window_steps = 400
"""
OWN_PART = """
from dataclasses import replace
from schema.parts import FIXED_BRICK
BRICK = replace(FIXED_BRICK)
"""
OWN_PARTS = """
[space]
part_types = [
  "schema.parts:CORE", "founder_parts:BRICK", "schema.parts:ACTIVE_HINGE",
  "schema.parts:HINGE", "schema.parts:PARAMETRIC_BAR_JOINT",
  "schema.parts:TOUCH_SENSOR",
]
"""


@pytest.fixture
def folder(workspace: Workspace, undisturbed: Path) -> Path:
    """Return the workspace's folder, with a run to start from."""
    shutil.copytree(undisturbed, workspace.folder / "source")
    return workspace.folder


def test_killed_islands_resume_without_the_run_that_they_started_from(
    workspace: Workspace, folder: Path
) -> None:
    (folder / "mixed.toml").write_text(MIXED + GIVEN)
    words = ("run", "mixed.toml", "--seed", "3", "--quiet", "--workers")
    workspace.run(*words, "1", "--out", "one")
    first = workspace.start(*words, "2", "--out", "two")
    kill_beyond(first, folder / "two", 0.5 * size(folder / "one"))
    (folder / "source").rename(folder / "moved")
    workspace.run("resume", "two", "--workers", "2", "--quiet")
    assert compare(folder / "one", folder / "two") == []
    # From another path, too.
    elsewhere = (folder / "mixed.toml").read_text().replace('"source"', '"moved"')
    (folder / "mixed.toml").write_text(elsewhere)
    workspace.run(*words, "2", "--out", "three")
    assert compare(folder / "one", folder / "three") == []
    assert arena_history(folder / "two", 1, 0.0)[1].history
    births = read_table(folder / "two", "births").to_pylist()
    # An arena inserts them in reverse order.
    births.sort(key=itemgetter("island", "birth"))
    origins = [row["origin_birth"] for row in births if row["birth"] < 5]
    assert len(origins) == 10
    assert origins[:5] == origins[5:]
    assert None not in origins


def test_a_stopped_campaign_keeps_its_founders(
    workspace: Workspace, folder: Path
) -> None:
    (folder / "short.toml").write_text(SHORT)
    words = ("run", "short.toml", "--from", "source", "--seed", "3", "--quiet")
    workspace.run(*words, "--in-process", "--out", "alone")
    first = workspace.start(*words, "--repeats", "2", "--workers", "1", "--out", "all")
    kill_beyond(first, folder / "all" / "short-0", 0.3 * size(folder / "alone"))
    shutil.rmtree(folder / "source")
    # As if the kill came before the second run began.
    shutil.rmtree(folder / "all" / "short-1", ignore_errors=True)
    workspace.run("resume", "all", "--in-process", "--quiet")
    assert compare(folder / "alone", folder / "all" / "short-0") == []
    first_births, second_births = (
        read_table(folder / "all" / f"short-{run}", "births", ["origin_digest"])
        for run in range(2)
    )
    assert first_births.equals(second_births)
    assert first_births["origin_digest"].null_count == 6


def test_robots_and_their_files_give_the_births_of_their_run(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(folder)
    Path("short.toml").write_text(SHORT)
    source = rv.Run("source")
    best = source.best(4)
    for number in (1, 3):
        best[number].write(f"{number}.yaml")
    mixed = [best[0], "1.yaml", best[2], Path("3.yaml")]
    starts: list[Any] = [best, mixed, source, "source"]
    runs = [
        rv.run("short.toml", founders=given, out=f"out-{number}", workers=1).births
        for number, given in enumerate(starts)
    ]
    columns = ["birth", "parents", "attempts", "body", "origin_digest"]
    assert runs[0].select(columns).equals(runs[1].select(columns))
    assert runs[2].drop_columns("run_id").equals(runs[3].drop_columns("run_id"))
    assert set(runs[2]["origin_run"].to_pylist()) == {source.run_id, None}
    names = [name and name[-6:] for name in runs[1]["origin_file"].to_pylist()[:4]]
    assert names == [None, "1.yaml", None, "3.yaml"]
    assert runs[0]["origin_file"].null_count == 12
    with pytest.raises(rv.ExperimentError, match=r"name it with founders\.run"):
        rv.run(rv.Run("out-0").experiment, seed=2)


MISTAKES = [
    ("", "short.toml: founders: must name files or a run"),
    ("files = ['a.pb']\nrun = 'b'", "founders.run: cannot be combined with founders.f"),
    ("files = ['a.pb']\nisland = 0", "island and population need founders.run"),
    ("run = 'source'\npopulation = 'lats'", "got 'lats'; did you mean 'last'?"),
    (
        "run = 'source'\npopulation = []",
        "must be 1 to selection.population = 6 births, got 0",
    ),
    (
        "run = 'source'\npopulation = [0, 1, 2, 3, 4, 5, 6]",
        "population = 6 births, got 7",
    ),
    ("run = 'source'\npopulation = [2, 999]", "source: has no birth 999 on island 0"),
    ("run = 'source'\nisland = 1", "no robot has a fitness on island 1"),
    ("run = 'gone'", "gone: no such folder"),
    ("files = ['gone.yaml']", "gone.yaml: cannot be read: No such file"),
    ("files = ['short.toml']", "must end in one of .yaml"),
    ("files = ['source/best.yaml']\n[space]\nmax_parts = 3", "outside space.min_parts"),
    ("run = 'source'\n[space]\nmax_parts = 3", "source: birth 0:"),
    ("files = ['source/best.yaml']\n[encoding]\ntype = 'cppn'", "makes no genome of"),
    (
        "run = 'source'\n[encoding]\ntype = 'cppn'",
        "another encoding than the experiment, or",
    ),
    ("run = 'source'\n[brain]\ntype = 'cpg'", "must be one of PhaseOscillator"),
    (f"run = 'source'{OWN_PARTS}", "FixedBrick is founder_parts:BRICK here, another"),
    ("run = 'source'\n[vetting]\nmode = 'contact'\ntolerance_m = 9.0", "intersect"),
    (f"genomes = [{{digest = '{'0' * 64}'}}]", "name it with founders.run"),
    (f"run = 'edited'{OWN_PARTS}", "has part types of plug-in founder_parts with anot"),
    # As Python gives robots.
    (
        f"files = ['0{UNNAMED}']\n[space]\nmax_parts = 3",
        "short: founders: robot 0: the",
    ),
]


@pytest.fixture(scope="module")
def careless(undisturbed: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder with a run, for documents that are refused."""
    folder = tmp_path_factory.mktemp("careless")
    shutil.copytree(undisturbed, folder / "source")
    shutil.copytree(undisturbed, folder / "edited")
    known = read_description(undisturbed)
    edited = replace(known, plugins={"founder_parts": KeptPlugin("0" * 12)})
    (folder / "edited" / "run.json").write_text(description_text(edited))
    rv.Run(undisturbed).best()[0].write(folder / "0.pb")
    (folder / "0.pb").rename(folder / f"0{UNNAMED}")
    (folder / "founder_parts.py").write_text(OWN_PART)
    return folder


@pytest.mark.parametrize(("keys", "message"), MISTAKES)
def test_each_mistake_gives_one_line(
    keys: str,
    message: str,
    careless: Path,
    monkeypatch: pytest.MonkeyPatch,
    capfd: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(careless)
    Path("short.toml").write_text(f"{SHORT}\n[founders]\n{keys}\n")
    before = sorted(Path().rglob("*"))
    assert main(["run", "short.toml", "--in-process", "--quiet"]) == 2
    said = capfd.readouterr()
    assert said.out == ""
    (line,) = said.err.splitlines()
    assert message in line
    assert sorted(Path().rglob("*")) == before
    assert main(["check", "short.toml", "--here", "900"]) == 1
    faults = [json.loads(line) for line in capfd.readouterr().out.splitlines()]
    assert faults[-1] == ["fault", line.partition("revolve: ")[2]]


def test_a_document_with_plug_ins_may_leave_the_run_to_the_flag(
    careless: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(careless)
    own = '[fitness]\nfunction = "founder_fitness:judge"\n[founders]\nrepeat = true\n'
    Path("flag.toml").write_text(SHORT.replace("births = 12", "births = 6") + own)
    Path("founder_fitness.py").write_text("def judge(trace, _):\n    return 1.0\n")
    words = ("--from", "source", "--in-process", "--quiet", "--out", "flag")
    assert main(["run", "flag.toml", *words]) == 0
    origins = rv.Run("flag").births["origin_birth"]
    assert (len(origins), origins.null_count) == (6, 0)


@pytest.mark.parametrize(
    ("founders", "line"),
    [
        (5, "founders: must be a list, or another iterable with an order, got 5"),
        ({"a.yaml"}, "founders: must be a list, or another iterable with an order"),
        ([5], "robot must be a Robot, got 5"),
        (["a.yaml", None], "robot must be a Robot, got None"),
    ],
)
def test_what_python_cannot_give_as_founders(founders: object, line: str) -> None:
    with pytest.raises(rv.RevolveError) as caught:
        rv.run("scenario1", founders=founders, out="never")  # type: ignore[arg-type]
    assert str(caught.value).startswith(line)


def test_a_changed_founder_is_refused(workspace: Workspace, folder: Path) -> None:
    (folder / "short.toml").write_text(SHORT)
    words = ("run", "short.toml", "--from", "source", "--quiet", "--out", "a")
    first = workspace.start(*words, "--workers", "1")
    kill_beyond(first, folder / "a", 500)
    file = folder / "a" / "run.json"
    text = file.read_text()
    place = text.index('"genome": "') + 40
    other = "B" if text[place] == "A" else "A"
    file.write_text(text[:place] + other + text[place + 1 :])
    told = workspace.run("resume", "a", "--in-process", "--quiet", code=2)
    (line,) = told.splitlines()
    assert "run.json: damaged: its digest is not that of its content" in line
