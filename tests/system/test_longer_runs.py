"""Runs that get more births: equal to those that were begun with as many."""

from pathlib import Path

import pytest

from coordinator.run.history import arena_history
from coordinator.run.lengthening import lengthen
from coordinator.storage.compare import compare
from schema.tables.description import read_description
from tests.system.documents import (
    ARENAS,
    BRIDGE,
    LEARNING,
    MIXED,
    OFF_LINE,
    RING,
    SMALL_ARENA,
)
from tests.system.fleet import kill_beyond, size
from tests.system.workspace import Workspace

pytestmark = [pytest.mark.system, pytest.mark.timeout(300)]

ALONE = ("--in-process", "--quiet")
HOLDS = (
    "a: already holds this run with 18 births; to resume it: "
    "revolve resume a --births 20; or choose another folder"
)


def begin(workspace: Workspace, document: str, births: int, name: str) -> Path:
    """Run a document to its end, in one process; return the run's folder."""
    (workspace.folder / "x.toml").write_text(document)
    words = ("--seed", "3", "--births", str(births), *ALONE)
    workspace.run("run", "x.toml", *words, "--out", name)
    return workspace.folder / name


@pytest.mark.parametrize(
    ("document", "before", "after"),
    [
        pytest.param(OFF_LINE, 21, 40, id="a brood cut short"),
        pytest.param(BRIDGE, 15, 24, id="re-evaluations"),
        pytest.param(LEARNING, 6, 9, id="learning"),
        pytest.param(RING, 34, 64, id="a ring whose islands had closed"),
        pytest.param(SMALL_ARENA, 8, 12, id="an arena"),
        pytest.param(ARENAS, 6, 10, id="arenas with migration"),
        pytest.param(MIXED, 21, 26, id="an island and an arena"),
    ],
)
def test_longer_run_equals_one_begun_with_as_many_births(
    workspace: Workspace, document: str, before: int, after: int
) -> None:
    wanted = begin(workspace, document, after, "wanted")
    longer = begin(workspace, document, before, "longer")
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
    wanted = begin(workspace, OFF_LINE, 40, "wanted")
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
    run = begin(workspace, document, 21, "a")
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


def test_mistakes_change_nothing(workspace: Workspace) -> None:
    run = begin(workspace, OFF_LINE, 18, "a")
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
    for name in ("epoch", "lock"):  # of every opening
        del before[run / name]
    after = {path: path.read_bytes() for path in before}
    assert after == before
    assert not [path for path in run.iterdir() if "rewritten" in path.name]
