"""Faults of the coordinator: kills at random instants, and a replacement while stopped.

test_equal_runs.py and test_arena_runs.py kill coordinators that have a network. These
tests kill many processes at instants that are independent of the journal.
"""

import os
import re
import signal
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from coordinator.storage.compare import compare
from coordinator.storage.journal import NAME
from coordinator.storage.lock import LOCK

pytestmark = [
    pytest.mark.system,
    pytest.mark.timeout(300),
    pytest.mark.skipif(sys.platform != "linux", reason="reads /proc"),
]

Workspace = Any
Fleets = Callable[..., Any]
PATIENCE_S = 120
ROOT = Path(__file__).parents[2]
KILLABLE = Path(__file__).with_name("killable.py")

OFF_LINE = """
name = "singles"
births = 40
[selection]
population = 8
children = 8
[simulation]
window_steps = 400
"""


@pytest.mark.slow
@pytest.mark.parametrize(("kind", "kills", "seed"), [("off", 40, 41), ("on", 20, 42)])
def test_kills_at_random_instants_give_equal_runs(
    tmp_path: Path, small_arena_document: str, kind: str, kills: int, seed: int
) -> None:
    """Sixty kills in total, each after up to half the time of a whole run."""
    document = OFF_LINE if kind == "off" else small_arena_document
    (tmp_path / "mine.toml").write_text(document)
    done = subprocess.run(
        [sys.executable, str(KILLABLE), "mine.toml", str(kills), str(seed)],
        cwd=tmp_path,
        env={**os.environ, "PYTHONPATH": str(ROOT)},
        capture_output=True,
        text=True,
        check=False,
        timeout=280,
    )
    sys.stdout.write(done.stdout)
    assert done.returncode == 0, done.stderr
    assert len(done.stdout.splitlines()) >= kills
    sizes = re.findall(r"at (\d+) bytes", done.stdout)
    assert len(set(sizes)) > kills // 4
    runs = sorted(tmp_path.glob("run-*"))
    assert len(runs) >= 2
    for run in runs:
        assert compare(tmp_path / "whole", run) == []


def stopped_coordinator(
    workspace: Workspace, fleet_of: Fleets, undisturbed: Path, births: int
) -> Any:  # noqa: ANN401 - a fleet
    """Return a fleet whose coordinator is stopped by SIGSTOP during its run."""
    words = ("scenario1", "--seed", "5", "--births", str(births), "--quiet")
    fleet = fleet_of(workspace, *words)
    fleet.join("judge", "analyzer")
    fleet.join("one")
    share = np.random.default_rng(43).uniform(0.2, 0.5)
    fleet.wait_for(share * (undisturbed / NAME).stat().st_size)
    fleet.coordinator.send_signal(signal.SIGSTOP)
    return fleet


def test_stopped_coordinator_keeps_the_lock_of_its_run(
    workspace: Workspace, undisturbed: Path, births: int, fleet_of: Fleets
) -> None:
    fleet = stopped_coordinator(workspace, fleet_of, undisturbed, births)
    output = workspace.run("resume", "run", "--quiet", code=2)
    assert f"in use by process {fleet.coordinator.pid} on " in output
    assert len(output.strip().splitlines()) == 1
    fleet.coordinator.send_signal(signal.SIGCONT)
    fleet.finish()
    assert compare(undisturbed, fleet.folder) == []


@pytest.mark.parametrize("when", ["meanwhile", "afterwards"])
def test_continued_coordinator_exits_and_writes_nothing_after_a_takeover(
    workspace: Workspace, undisturbed: Path, births: int, fleet_of: Fleets, when: str
) -> None:
    """The epoch detects a takeover on file systems without locks."""
    fleet = stopped_coordinator(workspace, fleet_of, undisturbed, births)
    (fleet.folder / LOCK).unlink()
    second = workspace.start("resume", "run", "--workers", "1", "--quiet")
    whole = (undisturbed / NAME).stat().st_size
    if when == "meanwhile":
        position = (fleet.folder / NAME).stat().st_size + 0.1 * whole
        fleet.wait_for(position)
    else:
        second.wait(PATIENCE_S)
    fleet.coordinator.send_signal(signal.SIGCONT)
    _, err = fleet.coordinator.communicate(timeout=PATIENCE_S)
    assert fleet.coordinator.returncode == 2, err
    assert "coordinator 2 has taken it over" in err
    assert "Traceback" not in err
    output = second.communicate(timeout=PATIENCE_S)
    assert second.returncode == 0, output
    assert compare(undisturbed, fleet.folder) == []
