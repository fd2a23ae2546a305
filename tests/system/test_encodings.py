"""Runs with other encodings than the thesis's: repeatable and resumed."""

from pathlib import Path

import pytest

from coordinator.islands.rows import body_rows
from coordinator.storage.compare import compare
from schema.parts import BUILT_IN
from schema.robot.robot import check_robot
from schema.tables.files import read_table
from schema.wire.protobuf import decode_robot
from tests.docs.page_runner import blocks_of
from tests.system.documents import OFF_LINE, SMALL_ARENA
from tests.system.fleet import kill_beyond, size
from tests.system.workspace import Workspace

pytestmark = [pytest.mark.system, pytest.mark.timeout(300)]

PAGE = Path(__file__).parents[2] / "docs" / "encodings.md"
WORMS = """
[encoding]
type = "my_worms:Worms"
[encoding.parameters]
most_joints = 6
"""
ISLANDS = """
[encoding]
type = "cppn"
[migration]
topology = "ring"
epoch = 8
[[islands]]
count = 2
"""


@pytest.fixture
def folder(workspace: Workspace) -> Path:
    """Return the workspace's folder, with the module of the page."""
    (text,) = blocks_of(PAGE, "python")
    (workspace.folder / "my_worms.py").write_text(text)
    return workspace.folder


def test_experiments_of_the_page_run(workspace: Workspace, folder: Path) -> None:
    first, second = blocks_of(PAGE, "toml")
    for name, document in (("first", first), ("second", second)):
        (folder / "mine.toml").write_text(document)
        words = ("--births", "20", "--in-process", "--quiet", "--out", name)
        workspace.run("run", "mine.toml", *words)


@pytest.mark.parametrize(("document", "births"), [(OFF_LINE, 30), (SMALL_ARENA, 12)])
def test_an_own_encoding_gives_the_same_births_on_two_workers(
    workspace: Workspace, folder: Path, document: str, births: int
) -> None:
    (folder / "worms.toml").write_text(document + WORMS)
    words = ("run", "worms.toml", "--seed", "5", "--births", str(births), "--quiet")
    for workers in ("1", "2"):
        workspace.run(*words, "--workers", workers, "--out", workers)
    assert compare(folder / "1", folder / "2") == []
    rows = read_table(folder / "1", "births").to_pylist()
    assert len(rows) == births
    assert max(row["rank"] for row in rows) > 1
    for row in rows:
        robot = decode_robot(row["robot"])
        check_robot(robot, BUILT_IN)
        assert body_rows(robot) == [
            {**part, "params": tuple(part["params"])} for part in row["body"]
        ]
    assert "well formed" in workspace.run("robot", "check", "1/best.yaml")


def test_killed_islands_of_cppn_resume_to_the_same_births(workspace: Workspace) -> None:
    folder = workspace.folder
    (folder / "patterns.toml").write_text(OFF_LINE + ISLANDS)
    words = ("run", "patterns.toml", "--seed", "5", "--births", "24", "--quiet")
    workspace.run(*words, "--in-process", "--out", "whole")
    first = workspace.start(*words, "--workers", "2", "--out", "killed")
    kill_beyond(first, folder / "killed", 0.6 * size(folder / "whole"))
    workspace.run("resume", "killed", "--workers", "2", "--quiet")
    assert compare(folder / "whole", folder / "killed") == []
    assert read_table(folder / "whole", "migrations").num_rows
    out = workspace.run("view", "whole", "--robot", "best", "--save", "a.rrd")
    assert "evaluates as recorded, equal to the last bit" in out
