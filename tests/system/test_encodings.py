"""Runs with other encodings than the thesis's: repeatable, resumed, refused."""

import re
import signal
from pathlib import Path
from typing import Any

import pytest

from coordinator.islands.rows import body_rows
from coordinator.storage.compare import compare
from schema.parts import BUILT_IN
from schema.robot.robot import check_robot
from schema.tables.files import read_table
from schema.wire.protobuf import decode_robot
from tests.system.documents import OFF_LINE, SMALL_ARENA
from tests.system.fleet import size
from tests.system.workspace import Until

pytestmark = [pytest.mark.system, pytest.mark.timeout(300)]

Workspace = Any

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


def _blocks(language: str) -> list[str]:
    pattern = re.compile(rf"^```{language}\n(.*?)^```", re.MULTILINE | re.DOTALL)
    return pattern.findall(PAGE.read_text())


def _write_worms(folder: Path, *changes: tuple[str, str]) -> Path:
    (text,) = _blocks("python")
    for old, new in changes:
        assert old in text
        text = text.replace(old, new)
    (folder / "my_worms.py").write_text(text)
    return folder


def test_experiments_of_the_page_run(workspace: Workspace) -> None:
    folder = _write_worms(workspace.folder)
    for number, document in enumerate(_blocks("toml")):
        (folder / "mine.toml").write_text(document)
        words = ("--births", "20", "--in-process", "--quiet", "--out", f"out{number}")
        workspace.run("run", "mine.toml", *words)
    assert number == 1


@pytest.mark.parametrize(("document", "births"), [(OFF_LINE, 30), (SMALL_ARENA, 12)])
def test_an_own_encoding_gives_the_same_births_on_two_workers(
    workspace: Workspace, document: str, births: int
) -> None:
    folder = _write_worms(workspace.folder)
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


def test_killed_islands_of_cppn_resume_to_the_same_births(
    workspace: Workspace, until: Until
) -> None:
    folder = workspace.folder
    (folder / "patterns.toml").write_text(OFF_LINE + ISLANDS)
    words = ("run", "patterns.toml", "--seed", "5", "--births", "24", "--quiet")
    workspace.run(*words, "--in-process", "--out", "whole")
    whole = (folder / "whole" / "journal.bin").stat().st_size
    first = workspace.start(*words, "--workers", "2", "--out", "killed")
    journal = folder / "killed" / "journal.bin"
    until(
        lambda: (
            first.poll() is not None
            or (journal.exists() and journal.stat().st_size > 0.6 * whole)
        ),
        "the run is on its way",
    )
    first.send_signal(signal.SIGKILL)
    first.wait()
    workspace.run("resume", "killed", "--workers", "2", "--quiet")
    assert compare(folder / "whole", folder / "killed") == []
    assert read_table(folder / "whole", "migrations").num_rows
    out = workspace.run("view", "whole", "--robot", "best", "--save", "a.rrd")
    assert "evaluates as recorded, equal to the last bit" in out


def test_a_run_is_not_resumed_with_changed_code(
    workspace: Workspace, until: Until
) -> None:
    folder = _write_worms(workspace.folder)
    (folder / "worms.toml").write_text(OFF_LINE + WORMS)
    words = ("run", "worms.toml", "--seed", "5", "--quiet", "--out", "run")
    first = workspace.start(*words, "--workers", "1")
    until(
        lambda: first.poll() is not None or size(folder / "run") > 0,
        "the run is on its way",
    )
    first.send_signal(signal.SIGINT)
    first.wait()
    resume = ("resume", "run", "--workers", "1", "--quiet")
    # Else the equal original is found, and the copy is not read.
    (folder / "my_worms.py").unlink()
    kept = next((folder / "run").rglob("my_worms.py"))
    text = kept.read_text()
    kept.write_text(text.replace("joint.phase, 1.0)", "joint.phase, 0.5)"))
    said = workspace.run(*resume, code=2)
    assert "my_worms" in said
    assert len(said.strip().splitlines()) == 1
    kept.write_text(text)
    workspace.run(*resume)
    assert _births(folder / "run") == 40


def _births(folder: Path) -> int:
    return (
        read_table(folder, "births").num_rows if (folder / "run.json").exists() else 0
    )


@pytest.mark.parametrize(
    ("old", "new", "problem"),
    [
        ("my_worms:Worms", "my_worms:Worm", "did you mean 'my_worms:Worms'?"),
        ("most_joints = 6", "most_joints = nan", "encoding.parameters"),
    ],
)
def test_a_wrong_document_is_refused_in_one_line(
    workspace: Workspace, old: str, new: str, problem: str
) -> None:
    folder = _write_worms(workspace.folder)
    (folder / "worms.toml").write_text(OFF_LINE + WORMS.replace(old, new))
    said = workspace.run("run", "worms.toml", "--out", "run", code=2)
    assert problem in said
    assert len(said.strip().splitlines()) == 1
    assert not (folder / "run").exists()


def test_a_broken_encoding_is_refused_before_the_first_birth(
    workspace: Workspace,
) -> None:
    folder = _write_worms(
        workspace.folder, ("rng.random())", "__import__('random').random())")
    )
    (folder / "worms.toml").write_text(OFF_LINE + WORMS)
    said = workspace.run("run", "worms.toml", "--out", "run", code=2)
    assert "encoding.type: my_worms.py:15: random: must return the same twice" in said
    assert not (folder / "run").exists()
