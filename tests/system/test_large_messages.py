"""Messages of all lengths pass a hub of its own, and no viewer stops it.

Sessions of this process stand for coordinator, worker and viewer.
"""

import os
import signal
import sys
import threading
import time

import pytest
import zenoh

from schema.agent.network import client_config
from schema.agent.topics import FleetMember
from schema.limits import MIB, PAGE_BYTES
from tests.system.fleet import kit_files, make_kit
from tests.system.workspace import (
    Workspace,
    free_address,
    runtime_directory,
    wait_until,
)

pytestmark = [pytest.mark.system, pytest.mark.slow]

TIMES = 20
LENGTHS = (1_000, 64_000, 1_000_000, 30_000_000)
CHIEF = FleetMember("default", "coordinator", "chief.1")
WORKER = FleetMember("default", "worker", "w-0.1")
MOST_QUERIES_PER_S = 10.0
MOST_QUERY_BYTES = 64
PROMPT_S = 4.0
"""Less than the engine waits for a process that does not read [s]."""
FROZEN_VIEWER = """
import os, signal, sys, time, zenoh
config, key, count, interval = sys.argv[1:]
session = zenoh.open(zenoh.Config.from_json5(config))
ignore = zenoh.handlers.Callback(lambda reply: None, indirect=False)
for _ in range(int(count)):
    session.get(key, ignore, timeout=60.0)
    time.sleep(float(interval))
os.kill(os.getpid(), signal.SIGSTOP)
"""


def start_hub(
    workspace: Workspace, protocol: str = "unixsock-stream", **variables: str
) -> str:
    """Start a hub; return the configuration of its clients."""
    address, tls = free_address(protocol), None
    if protocol == "unixsock-stream":
        address = f"{protocol}/{runtime_directory(workspace.folder)}/socket"
    if protocol == "tls":
        tls = kit_files(make_kit(workspace.folder / "lab").folder, "hub")
        files = {"CA": tls.ca, "CERTIFICATE": tls.certificate, "KEY": tls.key}
        variables |= {f"REVOLVE_TLS_{name}": file for name, file in files.items()}
    log = workspace.folder / "hub.log"
    workspace.start("hub", "--listen", address, environment=variables, log=log)
    wait_until(lambda: "listening on" in log.read_text(), "the hub listens")
    return client_config(address, tls)


def opened(config: str) -> zenoh.Session:
    return zenoh.open(zenoh.Config.from_json5(config))


def replies(
    session: zenoh.Session, key: str, payload: bytes = b"", timeout_s: float = 20.0
) -> list[bytes]:
    found = session.get(
        key,
        payload=payload,
        timeout=timeout_s,
        consolidation=zenoh.ConsolidationMode.NONE,
    )
    return [each.ok.payload.to_bytes() for each in found if each.ok]


def echo(query: zenoh.Query) -> None:
    """Reply with the bytes of a query, backwards."""
    with query:
        payload = query.payload
        data = b"" if payload is None else payload.to_bytes()
        query.reply(query.key_expr, data[::-1])


def wait_for_server(client: zenoh.Session, key: str = WORKER.jobs) -> None:
    """Wait until a client's queries of a key get replies."""
    wait_until(lambda: replies(client, key) != [], f"{key} is served")


@pytest.mark.parametrize("protocol", ["unixsock-stream", "tcp", "tls"])
def test_every_message_arrives(workspace: Workspace, protocol: str) -> None:
    """Requests and replies of a length pass; a connection sends 64 kB at once."""
    config = start_hub(workspace, protocol)
    with (
        opened(config) as server,
        opened(config) as client,
        server.declare_queryable(WORKER.jobs, echo),
    ):
        wait_for_server(client)
        for length in LENGTHS:
            sent = bytes(range(250)) * (length // 250)
            for _ in range(TIMES):
                got = replies(client, WORKER.jobs, sent)
                assert got == [sent[::-1]], (length, list(map(len, got)))


@pytest.mark.parametrize("threads", ["(rx: (worker_threads: 0))", "(garbage", ""])
def test_threads_that_the_user_sets_have_no_effect(
    workspace: Workspace, threads: str
) -> None:
    """Such a value ends a process with a panic; the hub writes one line instead."""
    config = start_hub(workspace, ZENOH_RUNTIME=threads)
    with (
        opened(config) as server,
        opened(config) as client,
        server.declare_queryable(WORKER.jobs, echo),
    ):
        wait_for_server(client)
        assert replies(client, WORKER.jobs, bytes(MIB)) == [bytes(MIB)]
    told, listening = (workspace.folder / "hub.log").read_text().splitlines()
    assert told == f"ZENOH_RUNTIME: has no effect here, got {threads!r}"
    assert "listening on" in listening


def test_a_hub_drops_long_and_frequent_requests_of_viewers(
    workspace: Workspace,
) -> None:
    config = start_hub(workspace)
    arrived: list[str] = []

    def answer(query: zenoh.Query) -> None:
        arrived.append(str(query.key_expr))
        echo(query)

    with (
        opened(config) as chief,
        opened(config) as viewer,
        chief.declare_queryable(CHIEF.state, answer, complete=True),
        chief.declare_queryable(CHIEF.command, answer, complete=True),
    ):
        wait_for_server(viewer, CHIEF.command)
        arrived.clear()
        assert replies(viewer, CHIEF.state, bytes(MOST_QUERY_BYTES + 1)) == []
        assert arrived == []
        times_s = []
        while len(arrived) < 4:
            before = len(arrived)
            replies(viewer, CHIEF.state)
            times_s += [time.monotonic()] * (len(arrived) - before)
        assert times_s[3] - times_s[1] >= 1.5 / MOST_QUERIES_PER_S
        arrived.clear()
        for _ in range(100):
            replies(viewer, CHIEF.command, bytes(MOST_QUERY_BYTES + 1))
        assert len(arrived) == 100


def test_a_viewer_that_does_not_read_delays_no_job(workspace: Workspace) -> None:
    config = start_hub(workspace)
    waiting: list[zenoh.Query] = []
    wait = zenoh.handlers.Callback(waiting.append, indirect=False)
    interval_s = 1.2 / MOST_QUERIES_PER_S
    with (
        opened(config) as worker,
        opened(config) as chief,
        worker.declare_queryable(WORKER.jobs, echo, complete=True),
        chief.declare_queryable(CHIEF.state, wait, complete=True),
    ):
        wait_for_server(chief)
        words = (config, CHIEF.state, "10", str(interval_s))
        viewer = workspace.start_command(sys.executable, "-c", FROZEN_VIEWER, *words)
        os.waitid(os.P_PID, viewer.pid, os.WSTOPPED | os.WNOWAIT)
        assert len(waiting) >= 3

        def reply() -> None:
            for query in waiting:
                with query:
                    for _ in range(8):
                        query.reply(CHIEF.state, bytes(PAGE_BYTES))

        thread = threading.Thread(target=reply)
        thread.start()
        for number in range(100):
            assert replies(chief, WORKER.jobs, b"%d" % number, PROMPT_S) != []
        viewer.send_signal(signal.SIGKILL)
        thread.join()
