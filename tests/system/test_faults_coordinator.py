"""Faults of the coordinator: it is stopped, and replaced while it is stopped.

test_equal_runs.py and test_arena_runs.py kill single coordinators, test_many_kills.py
kills many.
"""

import signal
import sys
from pathlib import Path

import numpy as np
import pytest

from coordinator.storage.compare import compare
from coordinator.storage.lock import LOCK
from tests.system.documents import SCENARIO1
from tests.system.fleet import Fleet, size
from tests.system.workspace import Workspace

pytestmark = [
    pytest.mark.system,
    pytest.mark.timeout(300),
    pytest.mark.skipif(sys.platform != "linux", reason="reads /proc"),
]

PATIENCE_S = 120


@pytest.mark.parametrize("when", ["meanwhile", "afterwards"])
def test_continued_coordinator_exits_and_writes_nothing_after_a_takeover(
    workspace: Workspace, undisturbed: Path, when: str
) -> None:
    """The epoch detects a takeover on file systems without locks."""
    fleet = Fleet(workspace, *SCENARIO1)
    fleet.join("judge", "analyzer")
    fleet.join("one")
    share = np.random.default_rng(43).uniform(0.2, 0.5)
    fleet.wait_for(share * size(undisturbed))
    fleet.coordinator.send_signal(signal.SIGSTOP)
    assert "in use by process" in workspace.run("resume", "run", "--quiet", code=2)
    (fleet.folder / LOCK).unlink()
    second = workspace.start("resume", "run", "--workers", "1", "--quiet")
    whole = size(undisturbed)
    if when == "meanwhile":
        position = size(fleet.folder) + 0.1 * whole
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
