"""Tests of ``revolve worker`` and ``revolve analyzer`` as started by a user."""

import os
import signal
import sys
import time

import pytest

from coordinator.dispatch.events import DispatchEvent, Joined, Left, Returned
from coordinator.network.service import Network
from tests.system.fleet import agent_processes
from tests.system.workspace import Workspace, free_address

pytestmark = pytest.mark.system

PATIENCE_S = 60.0
ROLES = ["worker", "analyzer"]


def until(network: Network, count: int) -> list[DispatchEvent]:
    events: list[DispatchEvent] = []
    end_s = time.monotonic() + PATIENCE_S
    while len(events) < count:
        assert time.monotonic() < end_s, events
        events += network.receive(0.2)
    return events


def agents(events: list[DispatchEvent]) -> list[str]:
    return [event.agent for event in events if isinstance(event, Joined)]


@pytest.mark.parametrize("role", ROLES)
def test_agent_reports_and_retries_a_missing_coordinator(
    workspace: Workspace, role: str
) -> None:
    address = free_address()
    process = workspace.start(role, "--connect", address, "--processes", "1")
    line = process.stderr.readline()
    complaint = f"no hub at {address}; retrying; press Ctrl-C to stop"
    assert line.endswith(f" warning: {complaint}\n")
    with Network(name="c", listen=(address,)) as network:
        (joined,) = until(network, 1)
        assert isinstance(joined, Joined)
        assert joined.kind == role
        network.send(1, joined.agent, b"\xff", PATIENCE_S)
        (refused,) = until(network, 1)
        assert isinstance(refused, Returned)
        assert refused.outcome == "error"
        process.send_signal(signal.SIGINT)
        assert until(network, 1) == [Left(joined.agent)]
    assert process.wait(PATIENCE_S) == 0
    rest = process.stderr.read()
    assert f"connected to {address}\n" in rest
    assert "refused 1 request, 1 of them malformed" in rest
    assert "Traceback" not in rest


@pytest.mark.skipif(sys.platform != "linux", reason="reads /proc")
def test_killed_process_is_replaced_under_another_name(workspace: Workspace) -> None:
    with Network(name="c") as network:
        flags = ("--connect", network.address, "--processes", "2", "--name", "box")
        process = workspace.start("worker", *flags)
        names = agents(until(network, 2))
        assert [name[:6] for name in sorted(names)] == ["box-0.", "box-1."]
        os.kill(agent_processes(process.pid)[0], signal.SIGKILL)
        gone, back = until(network, 2)
        assert isinstance(gone, Left)
        assert gone.agent in names
        (name,) = agents([back])
        assert name not in names
        assert name[:6] == gone.agent[:6]


@pytest.mark.parametrize("flags", [("--until-closed",), ()])
def test_agents_end_with_their_standard_input_or_command(
    workspace: Workspace, flags: tuple[str, ...]
) -> None:
    with Network(name="c") as network:
        words = ("worker", "--connect", network.address, "--processes", "2")
        process = workspace.start(*words, *flags)
        until(network, 2)
        if flags:
            # It closes the standard input first.
            process.communicate(timeout=PATIENCE_S)
            assert process.returncode == 0
        else:
            process.kill()
        assert all(isinstance(event, Left) for event in until(network, 2))


def test_a_run_finishes_where_the_path_of_temporary_files_is_long(
    workspace: Workspace,
) -> None:
    """That of a socket has 107 bytes at most."""
    folder = workspace.folder / ("d" * 100)
    folder.mkdir()
    workspace.environment["TMPDIR"] = str(folder)
    workspace.run("run", "scenario1", "--births", "17", "--workers", "1")
