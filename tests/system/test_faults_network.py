"""Interruptions of the network between machines: see ``machines.py``.

A disconnected worker counts as lost after its lease; other workers get its jobs.
"""

from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from coordinator.cluster.kit import MemberRole
from coordinator.storage.compare import compare
from tests.system.documents import HAMLET, SCENARIO1
from tests.system.fleet import Fleet, holders, kit_files, make_kit, size, tls_flags
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


def remote_fleet(
    network: Network, *words: str
) -> tuple[Fleet, Callable[[str, str, str], int]]:
    """Return a fleet with worker and analyzer, and what starts agents on a machine."""
    workspace = network.workspace

    members: dict[str, MemberRole] = {
        "far": "worker", "near": "worker", "judge": "analyzer"
    }  # fmt: skip
    kit = make_kit(workspace.folder / "lab", HOST, **members).folder

    def join(fleet: Fleet, name: str, role: str, machine: str) -> int:
        space = network[machine].space
        return fleet.join(name, role, *tls_flags(kit_files(kit, name)), inside=space)

    where = {"listen": f"tls/{HOST}:7447", "inside": network["near"].space}
    fleet = Fleet(workspace, *words, *tls_flags(kit_files(kit, "hub")), **where)
    start = partial(join, fleet)
    start("far", "worker", "far")
    start("judge", "analyzer", "near")
    return fleet, start


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
    network.slow_down("far", delay_s=0.05, loss=0.03)
    fleet, _ = remote_fleet(network, *SCENARIO1)
    fleet.wait_for(np.random.default_rng(31).uniform(0.1, 0.7) * size(undisturbed))
    network["far"].cut()
    wait_for_line(fleet.agents["far"], "no hub at")
    assert not fleet.is_over
    network["far"].reconnect()
    wait_for_line(fleet.agents["far"], "reconnected to")
    fleet.finish()
    assert compare(undisturbed, fleet.folder) == []


@pytest.mark.usefixtures("small_arena_workspace")
def test_arena_moves_to_another_worker_when_its_holder_is_disconnected(
    network: Network, small_arena_run: Path
) -> None:
    fleet, join = remote_fleet(network, *HAMLET, "--speed", "10")
    share = np.random.default_rng(32).uniform(0.1, 0.5)
    fleet.wait_for(share * size(small_arena_run))
    network["far"].cut()
    join("near", "worker", "near")
    fleet.wait_for((share + 0.3) * size(small_arena_run))
    network["far"].reconnect()
    fleet.finish()
    assert compare(small_arena_run, fleet.folder) == []
    assert set(holders(fleet.folder)) == {"far", "near"}
