"""Runs with other encodings than the thesis's: repeatable and resumed."""

from pathlib import Path

import pytest

from coordinator.storage.compare import compare
from schema.tables.files import read_table
from tests.docs.page_runner import blocks_of
from tests.system.documents import OFF_LINE
from tests.system.fleet import kill_beyond, size
from tests.system.workspace import Workspace

pytestmark = [pytest.mark.system, pytest.mark.timeout(300)]

PAGE = Path(__file__).parents[2] / "docs" / "encodings.md"
ISLANDS = """
[encoding]
type = "cppn"
[migration]
topology = "ring"
epoch = 8
[[islands]]
count = 2
"""


def test_experiments_of_the_page_run(workspace: Workspace) -> None:
    (module,) = blocks_of(PAGE, "python")
    (workspace.folder / "my_worms.py").write_text(module)
    first, second = blocks_of(PAGE, "toml")
    for name, document in (("first", first), ("second", second)):
        (workspace.folder / "mine.toml").write_text(document)
        words = ("--births", "20", "--in-process", "--quiet", "--out", name)
        workspace.run("run", "mine.toml", *words)


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
