"""The commands of docs/tutorials/08-lab.md on five machines, with fewer births."""

import json
import re
import shlex
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.system.fleet import size
from tests.system.machines import NEEDS_ROOT, Network
from tests.system.workspace import Workspace, wait_until

TUTORIAL = Path(__file__).parents[2] / "docs" / "tutorials" / "08-lab.md"

pytestmark = [
    pytest.mark.system,
    pytest.mark.slow,
    pytest.mark.timeout(600),
    NEEDS_ROOT,
]


@pytest.fixture
def network(workspace: Workspace) -> Iterator[Network]:
    with Network(workspace, ("hub", "a", "b", "c")) as made:
        yield made


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
