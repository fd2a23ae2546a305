"""A lab of several machines with a kit's certificates, as docs/cluster.md says."""

import json
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from datetime import UTC, datetime, timedelta
from pathlib import Path

import pytest
import zenoh

from coordinator.cluster.kit import Kit
from coordinator.storage.compare import compare
from schema.agent.network import client_config
from schema.agent.topics import Role
from tests.system.fleet import size
from tests.system.machines import NEEDS_ROOT, Machine, Network, Running
from tests.system.silent_agents import alive
from tests.system.workspace import Workspace, wait_until

pytestmark = [
    pytest.mark.system,
    pytest.mark.slow,
    pytest.mark.timeout(300),
    NEEDS_ROOT,
]

HUB = (
    *("hub", "--listen", "tls/0.0.0.0:7447", "--listen", "hub"),
    *("--access", "~/.config/revolve/access.json"),
)
LONG_RUN = ("scenario1", "--seed", "5", "--births", "450", "--quiet", "--out", "run")


@pytest.fixture
def network(workspace: Workspace) -> Iterator[Network]:
    names = ("hub", "a", "b", "c", "judge", "laptop")
    with Network(workspace, names) as made:
        yield made


@pytest.fixture
def lab(workspace: Workspace, network: Network) -> Path:
    """Return the folder of a kit whose members are installed on the machines."""
    kit = workspace.folder / "lab"
    words = ("--hub", "hub.example", "--workers", "a,b,c")
    workspace.run("cluster", "init", str(kit), *words)
    members = {name: name for name in ("hub", "a", "b", "c")}
    for name, member in (members | {"judge": "analyzer", "laptop": "viewer"}).items():
        network[name].install(kit / "members" / member)
    return kit


@contextmanager
def all_rights(machine: Machine) -> Iterator[zenoh.Session]:
    """Yield a session with all rights, by the Unix socket of the hub's machine."""
    address = f"unixsock-stream/{machine.runtime}/revolve/hub.sock"
    with zenoh.open(zenoh.Config.from_json5(client_config(address))) as session:
        yield session


def names(machine: Machine, role: Role) -> list[str]:
    """Return the names of the processes of a role that are alive."""
    with all_rights(machine) as session:
        return [member.name for member in alive(session, role)]


def intrude(
    machine: Machine, files: tuple[str, ...], victims: tuple[str, ...]
) -> Running:
    """Start an intruder that shows certificate files or none: see intruder.py."""
    program = str(Path(__file__).with_name("intruder.py"))
    protocol = "tls" if files else "tcp"
    shown = (*files, "", "", "")[:3]
    return machine.command(
        sys.executable, program, f"{protocol}/hub.example:7447", *shown, *victims
    )


def files_of(folder: Path, authority: Path | None = None) -> tuple[str, ...]:
    """Return the certificate files of a member, and the authority that it trusts."""
    own = ("certificate.pem", "key.pem")
    ca = (authority or folder) / "ca.pem"
    return (str(ca), *(str(folder / name) for name in own))


def expired(lab: Path, name: str) -> tuple[str, ...]:
    """Return the files of a worker of the lab whose certificate has expired."""
    kit = Kit.read(lab, lambda: datetime.now(UTC) - timedelta(days=91))
    kit.add(name, "worker")
    return files_of(lab / "members" / name)


def check_strangers(network: Network, lab: Path, victims: tuple[str, ...]) -> None:
    """Check that the hub refuses whoever has no valid certificate of its authority."""
    foreign = lab.with_name("foreign")
    network.workspace.run("cluster", "init", str(foreign), "--hub", "hub.example")
    shown: tuple[tuple[str, ...], ...] = (
        (),
        (str(lab / "ca.pem"),),
        files_of(foreign / "members" / "coordinator", lab),
        expired(lab, "late"),
    )
    strangers = [intrude(network["laptop"], files, victims) for files in shown]
    for stranger in strangers:
        assert "refused: " in stranger.end()


@pytest.mark.long
@pytest.mark.timeout(900)
def test_nobody_acts_beyond_its_certificate_on_bad_cables(
    network: Network, lab: Path, workspace: Workspace
) -> None:
    workspace.run("run", *LONG_RUN[:-1], "reference", "--in-process")
    folder, reference = network["hub"].home / "run", workspace.folder / "reference"

    def wait_for(share: float) -> None:
        least = share * size(reference)
        wait_until(lambda: size(folder) > least, f"{share} of the run")

    network.slow_down("a", delay_s=0.1, loss=0.03)
    hub = network["hub"].start(*HUB)
    hub.wait_for("listening on unixsock-stream/")
    coordinator = network["hub"].start("coordinator", *LONG_RUN, "--connect", "hub")
    workers = {
        name: network[name].start("worker", "--processes", "1") for name in "abc"
    }
    wait_until(lambda: len(names(network["hub"], "worker")) == 3, "three workers")
    wait_until(lambda: names(network["hub"], "coordinator") != [], "the coordinator")
    victims = (*names(network["hub"], "coordinator"), *names(network["hub"], "worker"))
    check_strangers(network, lab, victims[:2])
    members = {"b": "b", "laptop": "viewer"}
    insiders = {
        name: intrude(network[name], files_of(lab / "members" / member), victims[:2])
        for name, member in members.items()
    }
    for insider in insiders.values():
        insider.wait_for("connected")
    network["judge"].start("analyzer")
    wait_for(0.1)
    assert names(network["hub"], "worker") == list(victims[1:])
    network["b"].cut()
    workers["b"].wait_for("retrying")
    wait_for(0.3)
    network["b"].reconnect()
    workers["b"].wait_for("reconnected to")
    told = workspace.run("cluster", "revoke", str(lab), "c")
    assert "copy members/hub/access.json to the hub, and restart it" in told
    network["hub"].install(lab / "members" / "hub")
    hub.process.kill()
    hub.process.wait()
    for line in (
        "peer sent no certificates",
        "invalid peer certificate: BadSignature",
        "invalid peer certificate: certificate expired",
    ):
        assert line in hub.text
    again = network["hub"].start(*HUB)
    again.wait_for("listening on unixsock-stream/")
    workers["c"].wait_for("reconnected to")
    wait_until(lambda: len(names(network["hub"], "worker")) == 2, "two workers")
    insiders["c"] = intrude(network["c"], files_of(lab / "members" / "c"), victims[:2])
    insiders["c"].wait_for("connected")
    wait_for(0.7)
    assert coordinator.process.poll() is None
    assert names(network["hub"], "worker") == list(victims[1:3])
    results = {}
    for name, insider in insiders.items():
        insider.process.terminate()
        results[name] = json.loads(insider.end().partition("connected\n")[2])
        assert results[name].pop("rounds") > 3
    coordinator.end()
    assert compare(folder, reference) == []
    # A viewer may read the state; nobody may do anything else.
    assert results.pop("laptop").keys() <= {"reply of state"}
    assert results == {"b": {}, "c": {}}
