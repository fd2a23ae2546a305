"""Interruptions of the network between machines, which network namespaces simulate.

A cable connects two namespaces: that of the coordinator and that of a remote worker. A
disconnected worker counts as lost after its lease; other workers get its jobs.
"""

import os
import shutil
import subprocess
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from coordinator.islands.events import Advanced
from coordinator.storage.compare import compare
from coordinator.storage.journal import NAME, Journal
from schema.agent.network import Tls
from tests.system.fleet import Fleets
from tests.system.machines import ip

Workspace = Any
Certify = Callable[[Path, str, str, str], Tls]

HOST = "10.231.77.1"
PORT = 7447


pytestmark = [
    pytest.mark.system,
    pytest.mark.slow,
    pytest.mark.timeout(300),
    pytest.mark.skipif(
        not (shutil.which("ip") and shutil.which("openssl")),
        reason="makes network namespaces with ip, and certificates with openssl",
    ),
]


@dataclass(frozen=True)
class Cable:
    """Two machines and the cable between them."""

    near: str
    far: str

    def cut(self) -> None:
        ip(f"-n {self.far} link set wire down")

    def reconnect(self) -> None:
        ip(f"-n {self.far} link set wire up")


@pytest.fixture
def cable() -> Iterator[Cable]:
    made = Cable(f"revolve-near-{os.getpid()}", f"revolve-far-{os.getpid()}")
    try:
        for name in (made.near, made.far):
            ip(f"netns add {name}")
            ip(f"-n {name} link set lo up")
        ip(f"-n {made.near} link add wire type veth peer name wire netns {made.far}")
        for name, last in ((made.near, 1), (made.far, 2)):
            ip(f"-n {name} addr add 10.231.77.{last}/30 dev wire")
            ip(f"-n {name} link set wire up")
        yield made
    except PermissionError as error:
        pytest.skip(f"the kernel refuses network namespaces: {error}")
    finally:
        for name in (made.near, made.far):
            subprocess.run(
                ["ip", "netns", "del", name], capture_output=True, check=False
            )


@dataclass(frozen=True)
class RemoteFleets:
    """Makes fleets with a coordinator and a worker on two machines."""

    cable: Cable
    certify: Certify
    fleet_of: Fleets

    def fleet(
        self, workspace: Workspace, *words: str
    ) -> tuple[Any, Callable[[str], list[str]]]:
        """Return a fleet with a remote worker, and the TLS flags of a process."""

        def flags(name: str) -> list[str]:
            tls = self.certify(workspace.folder, name, "ca", HOST)
            files = ["--tls-ca", tls.ca, "--tls-certificate", tls.certificate]
            return [*files, "--tls-key", tls.key]

        listen, near = f"tls/{HOST}:{PORT}", self.cable.near
        own = flags("machine")
        fleet = self.fleet_of(workspace, *words, *own, listen=listen, inside=near)
        fleet.join("far", "worker", *flags("far"), inside=self.cable.far)
        return fleet, flags


@pytest.fixture
def remote_fleets(cable: Cable, certify: Certify, fleet_of: Fleets) -> RemoteFleets:
    return RemoteFleets(cable, certify, fleet_of)


def wait_for_line(process: Any, text: str) -> None:  # noqa: ANN401 - a process with pipes
    """Wait until a process writes a line that contains a text."""
    lines = [process.stderr.readline()]
    while text not in lines[-1]:
        assert lines[-1], lines
        lines.append(process.stderr.readline())


def test_disconnecting_a_worker_gives_an_equal_run(
    workspace: Workspace, undisturbed: Path, births: int, remote_fleets: RemoteFleets
) -> None:
    words = ("scenario1", "--seed", "5", "--births", str(births), "--quiet")
    fleet, flags = remote_fleets.fleet(workspace, *words)
    fleet.join("judge", "analyzer", *flags("judge"), inside=remote_fleets.cable.near)
    share = np.random.default_rng(31).uniform(0.1, 0.7)
    fleet.wait_for(share * (undisturbed / NAME).stat().st_size)
    remote_fleets.cable.cut()
    wait_for_line(fleet.agents["far"], "no hub at")
    assert not fleet.is_over
    remote_fleets.cable.reconnect()
    wait_for_line(fleet.agents["far"], "reconnected to")
    fleet.finish()
    assert compare(undisturbed, fleet.folder) == []


def test_arena_moves_to_another_worker_when_its_holder_is_disconnected(
    small_arena_workspace: Workspace, small_arena_run: Path, remote_fleets: RemoteFleets
) -> None:
    words = ("hamlet.toml", "--seed", "4", "--speed", "10", "--quiet")
    fleet, flags = remote_fleets.fleet(small_arena_workspace, *words)
    whole = (small_arena_run / NAME).stat().st_size
    share = np.random.default_rng(32).uniform(0.1, 0.5)
    fleet.join("judge", "analyzer", *flags("judge"), inside=remote_fleets.cable.near)
    fleet.wait_for(share * whole)
    remote_fleets.cable.cut()
    fleet.join("near", "worker", *flags("near"), inside=remote_fleets.cable.near)
    fleet.wait_for((share + 0.3) * whole)
    remote_fleets.cable.reconnect()
    fleet.finish()
    assert compare(small_arena_run, fleet.folder) == []
    with Journal.open(fleet.folder) as journal:
        events = journal.replay()
    advances = [event for event in events if isinstance(event, Advanced)]
    holders = [each.provenance.agent.partition("-")[0] for each in advances]
    assert sorted(dict.fromkeys(holders)) == ["far", "near"]
