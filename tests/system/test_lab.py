"""A lab of several machines with a kit's certificates, as docs/cluster.md says."""

from collections.abc import Iterator
from pathlib import Path

import pytest

from coordinator.storage.compare import compare
from tests.system.fleet import size
from tests.system.machines import NEEDS_ROOT, Network
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
RUN = ("scenario1", "--seed", "5", "--births", "60", "--quiet", "--out", "run")


@pytest.fixture
def network(workspace: Workspace) -> Iterator[Network]:
    names = ("hub", "a", "b", "c", "judge", "laptop")
    try:
        with Network(workspace, names) as made:
            yield made
    except PermissionError as error:
        pytest.skip(f"the kernel refuses network namespaces: {error}")


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


def test_commands_of_the_page(network: Network, lab: Path, undisturbed: Path) -> None:
    hub = network["hub"].start(*HUB)
    hub.wait_for("listening on unixsock-stream/")
    network["hub"].start("analyzer")
    coordinator = network["hub"].start("coordinator", *RUN, "--connect", "hub")
    for name in "abc":
        network[name].start("worker", "--processes", "1")
    folder = network["hub"].home / "run"
    wait_until(lambda: size(folder) > 0, "the run begins")
    network["laptop"].install(lab / "members" / "operator")
    status = [network[name].start("status") for name in ("laptop", "hub")]
    for each in status:
        assert "3 workers, 1 analyzers" in each.end()
    coordinator.end()
    assert compare(folder, undisturbed) == []
