"""Arenas that are divided over workers: equal to others, also beside silent workers.

test_many_kills.py kills workers and coordinators of divided arenas.
"""

import os
import signal
from pathlib import Path

import pytest

from coordinator.storage.compare import compare
from tests.system.fleet import Fleet, size
from tests.system.workspace import Workspace

pytestmark = pytest.mark.system

WORDS = ("crowd.toml", "--seed", "4", "--quiet", "--arena-workers", "4")


def test_divided_arena_is_equal_to_one_in_one_process(
    crowded_arena_workspace: Workspace, crowded_arena_run: Path
) -> None:
    told = crowded_arena_workspace.run("run", *WORDS, "--workers", "2", "--out", "run")
    assert "arena 0: 2 workers advance it together" in told
    assert compare(crowded_arena_run, crowded_arena_workspace.folder / "run") == []


def test_worker_that_stops_for_ever_does_not_hold_a_divided_arena(
    crowded_arena_workspace: Workspace, crowded_arena_run: Path
) -> None:
    fleet = Fleet(crowded_arena_workspace, *WORDS)
    stopped, *_ = [fleet.join(name) for name in ("w0", "w1", "w2")]
    fleet.begin(3)
    fleet.wait_for(0.3 * size(crowded_arena_run))
    os.kill(stopped, signal.SIGSTOP)
    fleet.finish()
    assert compare(crowded_arena_run, fleet.folder) == []
