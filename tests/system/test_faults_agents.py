"""Faults of workers and analyzers do not change the tables of a run.

The time of each fault is drawn with a fixed seed. Agents that are killed are tested in
test_equal_runs.py and test_arena_runs.py.
"""

import os
import signal
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from coordinator.islands.events import Advanced
from coordinator.storage.compare import compare
from coordinator.storage.journal import NAME, Journal
from tests.system.fleet import Fleet, agent_processes, size
from tests.system.stage import wait_until

pytestmark = [
    pytest.mark.system,
    pytest.mark.timeout(300),
    pytest.mark.skipif(sys.platform != "linux", reason="reads /proc"),
]

Stage = Any
Fleets = Callable[..., Any]
ROOT = Path(__file__).parents[2]
ODD_AGENT = Path(__file__).with_name("odd_agent.py")


def whole(folder: Path) -> int:
    """Return the length of a finished run's journal [bytes]."""
    return (folder / NAME).stat().st_size


def singles(births: int) -> tuple[str, ...]:
    return ("scenario1", "--seed", "5", "--births", str(births), "--quiet")


HAMLET = ("hamlet.toml", "--seed", "4", "--speed", "10", "--quiet")


def freeze_and_finish(fleet: Fleet, frozen: int, quiet: Path, seed: int) -> None:
    """Freeze a process for a third of a run; the run equals an undisturbed one."""
    share = np.random.default_rng(seed).uniform(0.1, 0.4)
    fleet.wait_for(share * whole(quiet))
    os.kill(frozen, signal.SIGSTOP)
    fleet.wait_for((share + 0.3) * whole(quiet))
    os.kill(frozen, signal.SIGCONT)
    fleet.finish()
    assert compare(quiet, fleet.folder) == []


def test_a_worker_is_frozen_and_comes_back(
    stage: Stage, undisturbed: Path, births: int, fleet_of: Fleets
) -> None:
    fleet = fleet_of(stage, *singles(births))
    frozen = fleet.join("one")
    fleet.join("two")
    fleet.begin(workers=2)
    freeze_and_finish(fleet, frozen, undisturbed, seed=21)


@pytest.mark.slow
def test_the_holder_of_an_arena_is_frozen_and_comes_back(
    hamlet_stage: Stage, quiet_hamlet: Path, fleet_of: Fleets
) -> None:
    fleet = fleet_of(hamlet_stage, *HAMLET)
    # The first by name is the holder.
    frozen = fleet.join("one")
    fleet.join("two")
    fleet.begin(workers=2)
    freeze_and_finish(fleet, frozen, quiet_hamlet, seed=22)
    with Journal.open(fleet.folder) as journal:
        events = journal.replay()
    holders = {
        each.provenance.agent[:3] for each in events if isinstance(each, Advanced)
    }
    assert holders == {"one", "two"}


def test_an_analyzer_is_lost_while_another_is_there(
    stage: Stage, undisturbed: Path, births: int, fleet_of: Fleets
) -> None:
    fleet = fleet_of(stage, *singles(births))
    fleet.join("judge", "analyzer")
    fleet.join("another", "analyzer")
    fleet.join("one")
    share = np.random.default_rng(23).uniform(0.1, 0.7)
    fleet.wait_for(share * whole(undisturbed))
    fleet.kill("judge")
    fleet.finish()
    assert compare(undisturbed, fleet.folder) == []


def test_the_only_analyzer_is_lost_and_replaced(
    stage: Stage, undisturbed: Path, births: int, fleet_of: Fleets
) -> None:
    fleet = fleet_of(stage, *singles(births))
    fleet.join("judge", "analyzer")
    fleet.join("one")
    share = np.random.default_rng(24).uniform(0.1, 0.7)
    fleet.wait_for(share * whole(undisturbed))
    fleet.kill("judge")
    fleet.join("another", "analyzer")
    fleet.finish()
    assert compare(undisturbed, fleet.folder) == []


def test_a_run_replaces_its_only_worker_when_somebody_asks_it_to_end(
    stage: Stage, undisturbed: Path, births: int
) -> None:
    folder = stage.folder / "run"
    words = (*singles(births), "--workers", "1", "--out", "run")
    command = stage.start("run", *words)
    share = np.random.default_rng(25).uniform(0.1, 0.7)
    wait_until(
        lambda: size(folder) > share * whole(undisturbed), "the run is on its way"
    )
    os.kill(agent_processes(command.pid)[-1], signal.SIGTERM)
    wait_until(lambda: command.poll() is not None, "the run ends")
    assert command.returncode == 0
    assert compare(undisturbed, folder) == []


@pytest.mark.parametrize("behaviour", ["twice", "late"])
def test_answers_come_twice_or_late(
    stage: Stage, undisturbed: Path, births: int, fleet_of: Fleets, behaviour: str
) -> None:
    fleet = fleet_of(stage, *singles(births))
    fleet.join("one")
    command = [sys.executable, str(ODD_AGENT), fleet.address, behaviour]
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    with subprocess.Popen(
        command, env=environment, stdout=subprocess.PIPE, text=True
    ) as odd:
        try:
            fleet.begin(workers=2)
            fleet.finish()
        finally:
            odd.terminate()
        assert odd.stdout is not None
        did = odd.stdout.read().split()
    assert did[0] == behaviour
    assert int(did[1]) > 0
    assert compare(undisturbed, fleet.folder) == []
