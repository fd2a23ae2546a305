"""How an agent opens its session, and what it does at its end."""

import os
import threading
from concurrent.futures import ThreadPoolExecutor

import pytest
import zenoh

from schema.agent import service
from schema.agent.address import new_socket
from schema.agent.network import Agent, hub_config
from schema.agent.request_handler import ReplyCounts
from schema.agent.service import Outlet, serve
from schema.agent.topics import FleetMember
from schema.wire.messages import Failure, Request, Result
from tests.system.workspace import wait_until


def compute(_: Request) -> Result:
    return Failure("nothing to do")


class NotedOutlet(Outlet):
    """Outlet that notes when the agent's session opens and is about to close."""

    def __init__(self, steps: list[str], stop: threading.Event) -> None:
        super().__init__()
        self._steps, self._stop = steps, stop

    def lead_to(self, session: zenoh.Session | None) -> None:
        super().lead_to(session)
        self._steps.append("closing" if session is None else "open")
        self._stop.set()


def test_totals_are_told_before_the_session_closes(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    steps: list[str] = []

    def totals(_name: str, counts: ReplyCounts) -> None:
        steps.append(f"{counts.refused} refused")

    monkeypatch.setattr(service, "_tell_totals", totals)
    stop, address = threading.Event(), new_socket()
    agent, outlet = Agent("worker", "w", address), NotedOutlet(steps, stop)
    with zenoh.open(zenoh.Config.from_json5(hub_config((address,)))):
        serve(compute, agent, stop, outlet=outlet)
    assert steps == ["open", "0 refused", "closing"]


def replies(session: zenoh.Session, key: str, payload: bytes | None) -> list[bytes]:
    """Return the replies to a query."""
    found = session.get(key, payload=payload, timeout=5.0)
    return [each.ok.payload.to_bytes() for each in found if each.ok]


def test_an_agent_says_that_a_coordinator_has_another_version() -> None:
    """The coordinator sends its version when it asks an agent for its properties."""
    stop, lines, address = threading.Event(), list[str](), new_socket()
    agent = Agent("worker", "w", address, version="2")
    key = FleetMember("default", "worker", "w").info
    with zenoh.open(zenoh.Config.from_json5(hub_config((address,)))) as hub:
        thread = threading.Thread(
            target=serve, args=(compute, agent, stop), kwargs={"warn": lines.append}
        )
        thread.start()
        try:
            wait_until(lambda: bool(replies(hub, key, None)), "the agent is there", 30)
            for version in (b"2", b"1\x1b", b"1\x1b", b"\xff" * 500):
                replies(hub, key, version)
            wait_until(lambda: len(lines) >= 2, "both are told", 30)
        finally:
            stop.set()
            thread.join()
    one, other = lines
    assert one == "refused by a coordinator of version 1?: this is 2"
    assert other.startswith("refused by a coordinator of version ")
    assert len(other) < 300


def test_a_reply_after_the_time_of_its_query_is_not_told(
    capfd: pytest.CaptureFixture[str],
) -> None:
    """The job is sent again, so that a slow machine is no reason for a warning."""
    late: list[zenoh.Query] = []
    with service.open_session(
        zenoh.Config.from_json5(hub_config((new_socket(),)))
    ) as session:
        session.declare_queryable("slow", late.append)
        found = [each.ok for each in session.get("slow", timeout=0.1)]
        assert found == [None]
        wait_until(lambda: bool(late), "the query arrives")
        with late.pop() as query:
            query.reply("slow", b"late")
    assert capfd.readouterr() == ("", "")


def test_threads_that_open_sessions_at_once_leave_the_environment(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Each of them changes it for the engine meanwhile."""
    monkeypatch.setenv("RUST_LOG", "off")
    monkeypatch.delenv("ZENOH_RUNTIME", raising=False)
    configs = [hub_config((new_socket(),)) for _ in range(8)]

    def opened(config: str) -> bool:
        with service.open_session(zenoh.Config.from_json5(config)) as session:
            return not session.is_closed()

    with ThreadPoolExecutor(len(configs)) as threads:
        assert [*threads.map(opened, configs)] == [True] * len(configs)
    assert os.environ.get("RUST_LOG") == "off"
    assert "ZENOH_RUNTIME" not in os.environ
