"""Repeatability after faults of workers and analyzers.

A fixed seed draws the instant of each fault. test_equal_runs.py, test_arena_runs.py and
test_many_kills.py contain the tests with killed workers.
"""

import os
import signal
import sys
from pathlib import Path

import numpy as np
import pytest

from coordinator.storage.compare import compare
from tests.system.documents import HAMLET, SCENARIO1
from tests.system.fleet import Fleet, advances, agent_processes, holders, size
from tests.system.workspace import Workspace, wait_until

pytestmark = [
    pytest.mark.system,
    pytest.mark.skipif(sys.platform != "linux", reason="reads /proc"),
]


def stop_continue_and_finish(
    fleet: Fleet, pid: int, reference: Path, seed: int
) -> None:
    """Stop a process for a third of a run; check that the run equals a reference."""
    share = np.random.default_rng(seed).uniform(0.1, 0.4)
    fleet.wait_for(share * size(reference))
    os.kill(pid, signal.SIGSTOP)
    fleet.wait_for((share + 0.3) * size(reference))
    os.kill(pid, signal.SIGCONT)
    fleet.finish()
    assert compare(reference, fleet.folder) == []


def test_stopping_and_continuing_a_worker_gives_an_equal_run(
    workspace: Workspace, undisturbed: Path
) -> None:
    fleet = Fleet(workspace, *SCENARIO1)
    stopped = fleet.join("one")
    fleet.join("two")
    fleet.begin(workers=2)
    stop_continue_and_finish(fleet, stopped, undisturbed, seed=21)


@pytest.mark.slow
def test_stopping_and_continuing_the_holder_of_an_arena_gives_an_equal_run(
    small_arena_workspace: Workspace, small_arena_run: Path
) -> None:
    fleet = Fleet(small_arena_workspace, *HAMLET, "--speed", "10")
    # The first by name is the holder.
    stopped = fleet.join("one")
    fleet.join("two")
    fleet.begin(workers=2)
    # Most of the journal are the founders, which are bred before.
    wait_until(lambda: "one" in holders(fleet.folder), "the arena is advanced")
    stop_continue_and_finish(fleet, stopped, small_arena_run, seed=22)
    assert set(holders(fleet.folder)) == {"one", "two"}


@pytest.mark.long
@pytest.mark.parametrize("is_spare_there", [True, False])
def test_losing_an_analyzer_gives_an_equal_run(
    workspace: Workspace, undisturbed: Path, *, is_spare_there: bool
) -> None:
    """One of two, or the only one, which is replaced."""
    fleet = Fleet(workspace, *SCENARIO1)
    fleet.join("judge", "analyzer")
    if is_spare_there:
        fleet.join("another", "analyzer")
    fleet.join("one")
    fleet.wait_for(np.random.default_rng(23).uniform(0.1, 0.7) * size(undisturbed))
    fleet.kill("judge")
    if not is_spare_there:
        fleet.join("another", "analyzer")
    fleet.finish()
    assert compare(undisturbed, fleet.folder) == []


def test_run_replaces_its_only_worker_after_sigterm(
    workspace: Workspace, undisturbed: Path
) -> None:
    folder = workspace.folder / "run"
    command = workspace.start("run", *SCENARIO1, "--workers", "1", "--out", "run")
    least = np.random.default_rng(25).uniform(0.1, 0.7) * size(undisturbed)
    wait_until(lambda: size(folder) > least, "the run is on its way")
    os.kill(agent_processes(command.pid)[-1], signal.SIGTERM)
    wait_until(lambda: command.poll() is not None, "the run ends")
    assert command.returncode == 0
    assert compare(undisturbed, folder) == []


@pytest.mark.parametrize("behaviour", ["twice", "late"])
def test_duplicate_and_late_answers_give_an_equal_run(
    workspace: Workspace, undisturbed: Path, behaviour: str
) -> None:
    fleet = Fleet(workspace, *SCENARIO1)
    fleet.join("one")
    with fleet.misbehaving(behaviour) as report:
        fleet.begin(workers=2)
        fleet.finish()
    assert int(report[0]) > 0
    assert compare(undisturbed, fleet.folder) == []


def test_arena_of_a_silent_worker_continues_on_an_idle_one(
    small_arena_workspace: Workspace, small_arena_run: Path
) -> None:
    fleet = Fleet(small_arena_workspace, *HAMLET)
    with fleet.misbehaving("silent") as report:
        fleet.join("one")
        fleet.begin(workers=2)
        fleet.finish()
    # It sent its late answer when the job was cancelled.
    assert report == ["1"]
    assert compare(small_arena_run, fleet.folder) == []
    agents = [each.provenance.agent[:3] for each in advances(fleet.folder)]
    first = agents.index("one")
    assert first >= 3
    assert agents == ["odd"] * first + ["one"] * (len(agents) - first)
    said = fleet.coordinator.stderr.read()
    assert said.count("has not answered for") == 1
    assert "takes its job" in said
