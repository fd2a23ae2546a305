"""An interruption of the network between machines: see ``machines.py``.

A disconnected worker counts as lost after its lease.
"""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from coordinator.cluster.kit import MemberRole
from coordinator.storage.compare import compare
from tests.system.documents import SCENARIO1
from tests.system.fleet import Fleet, kit_files, make_kit, size, tls_flags
from tests.system.machines import NEEDS_ROOT, Network
from tests.system.workspace import Workspace

HOST = "10.231.78.1"
"""Address of the machine ``near``."""

pytestmark = [
    pytest.mark.system,
    pytest.mark.slow,
    pytest.mark.timeout(300),
    NEEDS_ROOT,
]


@pytest.fixture
def network(workspace: Workspace) -> Iterator[Network]:
    with Network(workspace, ("near", "far")) as made:
        yield made


def wait_for_line(process: Any, text: str) -> None:  # noqa: ANN401 - a process with pipes
    """Wait until a process writes a line that contains a text."""
    lines = [process.stderr.readline()]
    while text not in lines[-1]:
        assert lines[-1], lines
        lines.append(process.stderr.readline())


def test_disconnecting_a_worker_gives_an_equal_run(
    network: Network, undisturbed: Path
) -> None:
    """Also by a cable that loses packets before and after."""
    workspace, near, far = network.workspace, network["near"], network["far"]
    members: dict[str, MemberRole] = {"far": "worker", "judge": "analyzer"}
    kit = make_kit(workspace.folder / "lab", HOST, **members).folder
    tls = {name: tls_flags(kit_files(kit, name)) for name in ("hub", *members)}
    network.slow_down("far", delay_s=0.05, loss=0.03)
    where = {"listen": f"tls/{HOST}:7447", "inside": near.space}
    fleet = Fleet(workspace, *SCENARIO1, *tls["hub"], **where)
    fleet.join("far", "worker", *tls["far"], inside=far.space)
    fleet.join("judge", "analyzer", *tls["judge"], inside=near.space)
    fleet.wait_for(np.random.default_rng(31).uniform(0.1, 0.7) * size(undisturbed))
    far.cut()
    wait_for_line(fleet.agents["far"], "no hub at")
    assert not fleet.is_over
    far.reconnect()
    wait_for_line(fleet.agents["far"], "reconnected to")
    fleet.finish()
    assert compare(undisturbed, fleet.folder) == []
