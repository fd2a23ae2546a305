"""Repeatability after faults of workers and analyzers.

A fixed seed draws the instant of each fault. test_equal_runs.py and test_arena_runs.py
contain the tests with killed agents.
"""

import os
import signal
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from coordinator.islands.events import Advanced
from coordinator.storage.compare import compare
from coordinator.storage.journal import NAME, Journal
from tests.system.fleet import Fleet, Fleets, agent_processes, size
from tests.system.workspace import wait_until

pytestmark = [
    pytest.mark.system,
    pytest.mark.timeout(300),
    pytest.mark.skipif(sys.platform != "linux", reason="reads /proc"),
]

Workspace = Any
ROOT = Path(__file__).parents[2]
MISBEHAVING_AGENT = Path(__file__).with_name("misbehaving_agent.py")


def journal_size(folder: Path) -> int:
    """Return the size of the journal of a finished run [bytes]."""
    return (folder / NAME).stat().st_size


def scenario1_words(births: int) -> tuple[str, ...]:
    return ("scenario1", "--seed", "5", "--births", str(births), "--quiet")


SMALL_ARENA = ("hamlet.toml", "--seed", "4", "--speed", "10", "--quiet")


def stop_continue_and_finish(
    fleet: Fleet, pid: int, reference: Path, seed: int
) -> None:
    """Stop a process for a third of a run; check that the run equals a reference."""
    share = np.random.default_rng(seed).uniform(0.1, 0.4)
    fleet.wait_for(share * journal_size(reference))
    os.kill(pid, signal.SIGSTOP)
    fleet.wait_for((share + 0.3) * journal_size(reference))
    os.kill(pid, signal.SIGCONT)
    fleet.finish()
    assert compare(reference, fleet.folder) == []


def test_stopping_and_continuing_a_worker_gives_an_equal_run(
    workspace: Workspace, undisturbed: Path, births: int, fleet_of: Fleets
) -> None:
    fleet = fleet_of(workspace, *scenario1_words(births))
    stopped = fleet.join("one")
    fleet.join("two")
    fleet.begin(workers=2)
    stop_continue_and_finish(fleet, stopped, undisturbed, seed=21)


@pytest.mark.slow
def test_stopping_and_continuing_the_holder_of_an_arena_gives_an_equal_run(
    small_arena_workspace: Workspace, small_arena_run: Path, fleet_of: Fleets
) -> None:
    fleet = fleet_of(small_arena_workspace, *SMALL_ARENA)
    # The first by name is the holder.
    stopped = fleet.join("one")
    fleet.join("two")
    fleet.begin(workers=2)
    stop_continue_and_finish(fleet, stopped, small_arena_run, seed=22)
    with Journal.open(fleet.folder) as journal:
        events = journal.replay()
    holders = {
        each.provenance.agent[:3] for each in events if isinstance(each, Advanced)
    }
    assert holders == {"one", "two"}


@pytest.mark.long
def test_losing_one_of_two_analyzers_gives_an_equal_run(
    workspace: Workspace, undisturbed: Path, births: int, fleet_of: Fleets
) -> None:
    fleet = fleet_of(workspace, *scenario1_words(births))
    fleet.join("judge", "analyzer")
    fleet.join("another", "analyzer")
    fleet.join("one")
    share = np.random.default_rng(23).uniform(0.1, 0.7)
    fleet.wait_for(share * journal_size(undisturbed))
    fleet.kill("judge")
    fleet.finish()
    assert compare(undisturbed, fleet.folder) == []


@pytest.mark.long
def test_replacing_the_only_analyzer_gives_an_equal_run(
    workspace: Workspace, undisturbed: Path, births: int, fleet_of: Fleets
) -> None:
    fleet = fleet_of(workspace, *scenario1_words(births))
    fleet.join("judge", "analyzer")
    fleet.join("one")
    share = np.random.default_rng(24).uniform(0.1, 0.7)
    fleet.wait_for(share * journal_size(undisturbed))
    fleet.kill("judge")
    fleet.join("another", "analyzer")
    fleet.finish()
    assert compare(undisturbed, fleet.folder) == []


def test_run_replaces_its_only_worker_after_sigterm(
    workspace: Workspace, undisturbed: Path, births: int
) -> None:
    folder = workspace.folder / "run"
    words = (*scenario1_words(births), "--workers", "1", "--out", "run")
    command = workspace.start("run", *words)
    share = np.random.default_rng(25).uniform(0.1, 0.7)
    wait_until(
        lambda: size(folder) > share * journal_size(undisturbed),
        "the run is on its way",
    )
    os.kill(agent_processes(command.pid)[-1], signal.SIGTERM)
    wait_until(lambda: command.poll() is not None, "the run ends")
    assert command.returncode == 0
    assert compare(undisturbed, folder) == []


@pytest.mark.parametrize("behaviour", ["twice", "late"])
def test_duplicate_and_late_answers_give_an_equal_run(
    workspace: Workspace,
    undisturbed: Path,
    births: int,
    fleet_of: Fleets,
    behaviour: str,
) -> None:
    fleet = fleet_of(workspace, *scenario1_words(births))
    fleet.join("one")
    command = [sys.executable, str(MISBEHAVING_AGENT), fleet.address, behaviour]
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    with subprocess.Popen(
        command, env=environment, stdout=subprocess.PIPE, text=True
    ) as agent_process:
        try:
            fleet.begin(workers=2)
            fleet.finish()
        finally:
            agent_process.terminate()
        assert agent_process.stdout is not None
        report = agent_process.stdout.read().split()
    assert report[0] == behaviour
    assert int(report[1]) > 0
    assert compare(undisturbed, fleet.folder) == []
