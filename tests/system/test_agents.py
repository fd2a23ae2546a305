"""Tests of ``revolve worker`` and ``revolve analyzer`` as started by a user."""

import os
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from coordinator.dispatch.events import DispatchEvent, Joined, Left, Returned
from coordinator.network.service import Network

pytestmark = pytest.mark.system

ROOT = Path(__file__).parents[2]
PATIENCE_S = 60.0
ROLES = ["worker", "analyzer"]


@contextmanager
def command(*words: str) -> Iterator[subprocess.Popen[str]]:
    with subprocess.Popen(
        [sys.executable, "-m", "revolve", *words],
        cwd=ROOT,
        stdin=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    ) as process:
        try:
            yield process
        finally:
            process.kill()


def free_address() -> str:
    with socket.create_server(("127.0.0.1", 0)) as server:
        return f"tcp/127.0.0.1:{server.getsockname()[1]}"


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
def test_agent_reports_and_retries_a_missing_coordinator(role: str) -> None:
    address = free_address()
    with command(role, "--connect", address, "--processes", "1") as process:
        assert process.stderr is not None
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


def children(pid: int) -> list[int]:
    """Return the agent processes among the children of a process."""
    listing = Path(f"/proc/{pid}/task/{pid}/children").read_text("utf-8").split()
    lines = {
        int(child): Path(f"/proc/{child}/cmdline").read_bytes() for child in listing
    }
    return [child for child, line in lines.items() if b"spawn_main" in line]


@pytest.mark.skipif(sys.platform != "linux", reason="reads /proc")
def test_killed_process_is_replaced_under_another_name() -> None:
    with Network(name="c") as network:
        flags = ("--connect", network.address, "--processes", "2", "--name", "box")
        with command("worker", *flags) as process:
            names = agents(until(network, 2))
            assert [name[:6] for name in sorted(names)] == ["box-0.", "box-1."]
            os.kill(children(process.pid)[0], signal.SIGKILL)
            gone, back = until(network, 2)
            assert isinstance(gone, Left)
            assert gone.agent in names
            (name,) = agents([back])
            assert name not in names
            assert name[:6] == gone.agent[:6]


def test_agents_end_when_their_standard_input_closes() -> None:
    with Network(name="c") as network:
        flags = ("--connect", network.address, "--processes", "2", "--until-closed")
        with command("worker", *flags) as process:
            until(network, 2)
            assert process.stdin is not None
            process.stdin.close()
            assert process.wait(PATIENCE_S) == 0
            assert all(isinstance(event, Left) for event in until(network, 2))


def test_agents_do_not_outlive_their_command() -> None:
    with Network(name="c") as network:
        flags = ("--connect", network.address, "--processes", "2")
        with command("worker", *flags) as process:
            until(network, 2)
            process.kill()
            assert all(isinstance(event, Left) for event in until(network, 2))
