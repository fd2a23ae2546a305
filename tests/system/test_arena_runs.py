"""Repeatability of arenas without a holder, and of runs with other encodings.

test_many_kills.py kills the coordinators of arenas, and random workers.
"""

import shutil
from pathlib import Path

import numpy as np
import pytest

from coordinator.storage.compare import compare
from schema.tables.columns import TABLES
from schema.tables.files import read_table
from tests.docs.page_runner import blocks_of
from tests.system.documents import OFF_LINE, SMALL_ARENA
from tests.system.fleet import Fleet, holders, kill_beyond, size
from tests.system.workspace import Workspace, wait_until

pytestmark = pytest.mark.system

EXAMPLES = Path(__file__).parents[2] / "docs" / "examples"
WORDS = ("crowd.toml", "--seed", "4", "--quiet")


@pytest.mark.parametrize("threads", [1, 4])
def test_number_of_threads_does_not_change_an_arena(
    crowded_arena_workspace: Workspace, crowded_arena_run: Path, threads: int
) -> None:
    flags = ("--workers", "1", "--threads", str(threads), "--out", "run")
    crowded_arena_workspace.run("run", *WORDS, *flags)
    assert compare(crowded_arena_run, crowded_arena_workspace.folder / "run") == []
    filled = {name for name in TABLES if read_table(crowded_arena_run, name).num_rows}
    assert filled >= {"births", "fitness", "poses", "population", "touches", "deaths"}


def test_rule_that_remembers_is_repeatable_in_two_arenas_with_a_kill(
    workspace: Workspace,
) -> None:
    folder, rule = workspace.folder, '"novelty:Novelty"'
    shutil.copy(EXAMPLES / "novelty.py", folder)
    small = SMALL_ARENA.replace("= 5\n", f"= 5\nparents = {rule}\n", 1)
    islands = "[[islands]]\n[[islands]]\n[migration]\ntopology = 'ring'\nepoch = 7\n"
    (folder / "two.toml").write_text(f"{small}{islands}emigrants = {rule}\n")
    words = ("run", "two.toml", "--seed", "4", "--quiet", "--out")
    workspace.run(*words, "calm", "--in-process")
    killed = workspace.start(*words, "killed", "--workers", "2")
    journal, half = folder / "killed" / "journal.bin", size(folder / "calm") // 2
    wait_until(lambda: journal.exists() and journal.stat().st_size > half, "half")
    killed.kill()
    killed.communicate()
    workspace.run("resume", "killed", "--workers", "1", "--quiet")
    assert compare(folder / "calm", folder / "killed") == []
    assert read_table(folder / "calm", "migrations").num_rows


@pytest.mark.long
@pytest.mark.parametrize("draw", range(3))
def test_killing_the_holder_twice_with_a_spare_worker_gives_an_equal_arena(
    crowded_arena_workspace: Workspace, crowded_arena_run: Path, draw: int
) -> None:
    fleet = Fleet(crowded_arena_workspace, *WORDS, "--speed", "20")
    fleet.join("judge", "analyzer")
    fleet.join("w0")
    for number, share in enumerate(np.random.default_rng(draw).uniform(0.05, 0.45, 2)):
        fleet.join(f"w{number + 1}")
        fleet.wait_for((share + 0.4 * number) * size(crowded_arena_run))
        fleet.kill(holders(fleet.folder)[-1])
    fleet.finish()
    assert compare(crowded_arena_run, fleet.folder) == []
    assert len(set(holders(fleet.folder))) == 3


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
