"""A worker that never answers, and the arena that it ran."""

import sys
from pathlib import Path

import pytest

from coordinator.storage.compare import compare
from tests.system.documents import HAMLET
from tests.system.fleet import Fleet, advances
from tests.system.workspace import Workspace

pytestmark = [
    pytest.mark.system,
    pytest.mark.timeout(300),
    pytest.mark.skipif(sys.platform != "linux", reason="reads /proc"),
]


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
