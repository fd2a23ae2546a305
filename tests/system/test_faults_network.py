"""Machines on a network (see ``machines.py``): an interruption, and the tutorial.

A disconnected worker counts as lost after its lease.
"""

import json
import re
import shlex
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from coordinator.cluster.kit import MemberRole
from coordinator.storage.compare import compare
from tests.system.documents import SCENARIO1
from tests.system.fleet import Fleet, kit_files, make_kit, size, tls_flags
from tests.system.machines import HOST, NEEDS_ROOT, Network
from tests.system.workspace import Workspace, wait_until

pytestmark = [
    pytest.mark.system,
    pytest.mark.slow,
    NEEDS_ROOT,
]


@pytest.fixture
def network(workspace: Workspace) -> Iterator[Network]:
    with Network(workspace, ("hub", "a", "b", "c")) as made:
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
    workspace, near, far = network.workspace, network["hub"], network["a"]
    members: dict[str, MemberRole] = {"far": "worker", "judge": "analyzer"}
    kit = make_kit(workspace.folder / "lab", HOST, **members).folder
    tls = {name: tls_flags(kit_files(kit, name)) for name in ("hub", *members)}
    network.slow_down("a", delay_s=0.05, loss=0.03)
    where = {"listen": f"tls/{HOST}:7447", "inside": near.space}
    fleet = Fleet(workspace, *SCENARIO1, *tls["hub"], **where)
    fleet.join("far", "worker", *tls["far"], inside=far.space)
    # It may have told that there is no hub: over a bad cable not every try succeeds.
    wait_for_line(fleet.agents["far"], "connected to")
    fleet.join("judge", "analyzer", *tls["judge"], inside=near.space)
    fleet.wait_for(np.random.default_rng(31).uniform(0.1, 0.7) * size(undisturbed))
    far.cut()
    wait_for_line(fleet.agents["far"], "no hub at")
    assert not fleet.is_over
    far.reconnect()
    wait_for_line(fleet.agents["far"], "reconnected to")
    fleet.finish()
    assert compare(undisturbed, fleet.folder) == []


TUTORIAL = Path(__file__).parents[2] / "docs" / "tutorials" / "08-lab.md"


def _commands() -> list[list[str]]:
    """Return the words of all commands of the page, with fewer births, in order."""
    text = TUTORIAL.read_text("utf-8")
    found = re.findall(r"^```\n(.*?)^```$", text, re.MULTILINE | re.DOTALL)
    lines = "".join(found).replace("--births 600", "--births 60").splitlines()
    return [shlex.split(line) for line in lines]


def test_commands_of_the_tutorial(network: Network, workspace: Workspace) -> None:
    init, *rest = _commands()
    copies = [words for words in rest if words[0] == "scp"]
    assert len(copies) == 4
    rest = [words[1:] for words in rest if words[0] == "revolve"]
    hub, analyzer, coordinator, worker, doctor, reference, comparison = rest
    workspace.run(*init[1:])
    for _, _, source, target in copies:
        name, place = target.split(".example:")
        assert place == ".config/revolve"
        network[name].install(workspace.folder / source)
    machine = network["hub"]
    machine.start(*hub).wait_for("listening on unixsock-stream/")
    machine.start(*analyzer)
    assert "ok    hub" in network["a"].start(*doctor).end()
    run = machine.start(*coordinator, "--quiet")
    folder = machine.home / "runs" / "lab"
    wait_until((folder / "address").exists, "the coordinator is connected")
    # It has no workers yet, so that the run cannot end before this.
    (told,) = json.loads(machine.start("status", "--json").end())["coordinators"]
    assert (told["workers"], told["analyzers"]) == (0, 1)
    workers = [network[name].start(*worker, "--processes", "1") for name in "abc"]
    wait_until(lambda: size(folder) > 1000, "births")
    workers[1].process.kill()
    run.end()
    machine.start(*reference, "--quiet").end()
    assert "equal in all repeatable columns" in machine.start(*comparison).end()
