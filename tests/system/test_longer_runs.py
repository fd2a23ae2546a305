"""Runs that get more births: equal to those that were begun with as many."""

import shutil
from pathlib import Path

import pytest
from msgspec.structs import replace

from coordinator.run.history import arena_history
from coordinator.run.lengthening import lengthen
from coordinator.storage.compare import compare
from coordinator.storage.lock import FolderLock
from revolve.command import main
from schema.tables.description import description_text, read_description
from tests.system.documents import (
    ARENAS,
    BRIDGE,
    DIVERSE,
    LEARNING,
    MIXED,
    OFF_LINE,
    RING,
    SEASONS,
)
from tests.system.fleet import kill_beyond, size
from tests.system.workspace import Workspace

pytestmark = pytest.mark.system

ALONE = ("--in-process", "--quiet")
OPENED = ("epoch", "lock")
"""Files that each opening of a run changes."""
HOLDS = (
    "a: already holds this run with 18 births; to resume it: "
    "revolve resume a --in-process --births 20; or choose another folder"
)


@pytest.mark.parametrize(
    ("document", "before", "after"),
    [
        pytest.param(OFF_LINE, 21, 40, id="a brood cut short"),
        pytest.param(BRIDGE, 15, 24, id="re-evaluations in a world that changes"),
        pytest.param(LEARNING, 6, 9, id="learning"),
        pytest.param(RING, 34, 48, id="a ring whose islands had closed"),
        pytest.param(DIVERSE, 14, 24, id="islands of all rules of diversity"),
        pytest.param(SEASONS, 8, 12, id="an arena in a world that changes"),
        pytest.param(ARENAS, 6, 10, id="arenas with migration"),
        pytest.param(MIXED, 21, 26, id="an island and an arena"),
    ],
)
def test_longer_run_equals_one_begun_with_as_many_births(
    workspace: Workspace, document: str, before: int, after: int
) -> None:
    wanted = workspace.finished(document, after, "wanted")
    longer = workspace.finished(document, before, "longer")
    shorter = size(longer)
    words = ("resume", "longer", "--births", str(after), "--quiet", "--workers", "2")
    process = workspace.start(*words)
    kill_beyond(process, longer, (shorter + size(wanted)) / 2)
    workspace.run("resume", "longer", *ALONE)
    assert compare(wanted, longer) == []
    theirs, ours = map(read_description, (wanted, longer))
    assert theirs.document == ours.document


def test_stopped_run_is_lengthened_without_computing_anything_again(
    workspace: Workspace,
) -> None:
    wanted = workspace.finished(OFF_LINE, 40, "wanted")
    words = ("run", "x.toml", "--seed", "3", "--births", "30", "--quiet")
    process = workspace.start(*words, "--out", "longer", "--workers", "1")
    longer = workspace.folder / "longer"
    kill_beyond(process, longer, size(wanted) / 3)
    told = workspace.run("resume", "longer", "--births", "40", *ALONE)
    assert "longer: 40 births instead of 30\n" in told
    assert compare(wanted, longer) == []
    told = workspace.run("resume", "longer", "--births", "40", *ALONE)
    assert "already finished" in told


def test_an_arena_keeps_its_state_from_before_an_island_has_closed(
    workspace: Workspace,
) -> None:
    often = "record_touches = true\nsnapshot_interval_s = 5.0"
    document = MIXED.replace("record_touches = true", often)
    run = workspace.finished(document, 21, "a")
    lengthen(run, 26)
    _, rebuild = arena_history(run, 1, from_s=1e6)
    assert rebuild.snapshot


def test_campaign_and_its_runs_get_longer(workspace: Workspace) -> None:
    (workspace.folder / "x.toml").write_text(OFF_LINE)
    words = ("run", "x.toml", "--seed", "3", "--repeats", "2", *ALONE)
    workspace.run(*words, "--births", "18", "--out", "longer")
    workspace.run(*words, "--births", "26", "--out", "wanted")
    refused = workspace.run("resume", "longer", "--births", "17", *ALONE, code=2)
    assert "longer/singles-0: --births: must be >= 18, the births that the" in refused
    again = workspace.run(*words, "--births", "26", "--out", "longer", code=2)
    assert "this campaign with 18 births; to resume it: revolve resume longer" in again
    workspace.run("resume", "longer", "--births", "26", *ALONE)
    assert compare(workspace.folder / "longer", workspace.folder / "wanted") == []
    told = workspace.run("resume", "longer", *ALONE)
    assert "2 of 2 runs already finished" in told
    assert "keeps its own" not in told


@pytest.fixture(scope="module")
def careless(undisturbed: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder with runs that cannot get longer."""
    folder = tmp_path_factory.mktemp("careless")
    for name in ("sound", "older", "lost", "torn", "locked"):
        shutil.copytree(undisturbed, folder / name)
    older = replace(read_description(undisturbed), version="0.2.1")
    (folder / "older" / "run.json").write_text(description_text(older))
    (folder / "lost" / "journal.bin").unlink()
    (folder / "torn" / "run.json").write_text("{")
    (folder / "empty").mkdir()
    return folder


@pytest.mark.parametrize(
    ("words", "line"),
    [
        ("older --births 900", "Revolve Islands 0.2 began this run, and this is"),
        ("lost --births 900", "lost/journal.bin: is lost: put a sound copy"),
        ("torn --births 900", "torn/run.json: damaged: "),
        ("locked --births 900", "locked: in use by process "),
        ("locked --births 0", "--births: must be a whole number"),
        ("sound --births 9999999999", "number in 1..1000000000, got"),
        ("locked --births", "--births: expected one argument"),
        ("empty --births 900", "empty: no run is there (run.json is missing)"),
        ("older/run.json --births 900", "must be a folder, got a file"),
    ],
)
def test_each_mistake_is_one_line(
    words: str,
    line: str,
    careless: Path,
    monkeypatch: pytest.MonkeyPatch,
    capfd: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(careless)
    files = [path for path in Path().rglob("*") if path.is_file()]
    before = {path: path.read_bytes() for path in files if path.name not in OPENED}
    with FolderLock(Path("locked")):
        try:
            code = main(["resume", *words.split(), *ALONE])
        except SystemExit as stop:
            code = int(str(stop.code))
    (said,) = capfd.readouterr().err.splitlines()
    assert (code, line in said) == (2, True), said
    assert {path: path.read_bytes() for path in before} == before


def test_mistakes_change_nothing(workspace: Workspace) -> None:
    run = workspace.finished(OFF_LINE, 18, "a")
    before = {path: path.read_bytes() for path in run.rglob("*") if path.is_file()}
    again = ("run", "x.toml", *ALONE, "--out", "a", "--births")
    for words, line in (
        (("resume", "a", "--births", "17"), "a: --births: must be >= 18, the births"),
        (("resume", "a", "--births", "7"), "a with --births 7: births: must be >="),
        (("resume", "a", "--births", "x"), "--births: must be a whole number"),
        (("resume", "b", "--births", "20"), "b: no such folder"),
        (("resume", ".", "--births", "20"), "holds several runs; give one of them"),
        ((*again, "20", "--seed", "3"), HOLDS),
        ((*again, "20", "--seed", "4"), "a: already holds a run with other settings;"),
    ):
        assert line in workspace.run(*words, code=2)
    for name in OPENED:
        del before[run / name]
    after = {path: path.read_bytes() for path in before}
    assert after == before
    assert not [path for path in run.iterdir() if "rewritten" in path.name]
