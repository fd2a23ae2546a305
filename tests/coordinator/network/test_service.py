"""The coordinator's end of the network, with real processes on loopback."""

import ctypes
import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from fnmatch import fnmatch
from itertools import pairwise
from pathlib import Path
from statistics import median

import pytest
import zenoh

from coordinator.dispatch.events import (
    Client,
    DispatchEvent,
    Job,
    Joined,
    Left,
    Progressed,
    Returned,
)
from coordinator.dispatch.fleet import JobRouter
from coordinator.network.client_service import asking
from coordinator.network.operator_service import OperatorQuery
from coordinator.network.service import Network
from schema.agent.network import client_config
from schema.agent.service import session_config
from schema.agent.topics import FleetMember
from schema.errors import MalformedMessage, NetworkError
from schema.limits import (
    ANSWER_BYTES,
    INFO_BYTES,
    LONGEST_QUIET_S,
    OPERATOR_REQUEST_BYTES,
)
from schema.robot.ids import BirthId
from schema.robot.robot import Part, Robot
from schema.wire.codec import decode, encode
from schema.wire.messages import AgentInfo, Answer, Evaluate, Reply, Request
from tests.system.fleet import introduce
from tests.system.workspace import wait_until

pytestmark = pytest.mark.system

ROOT = Path(__file__).parents[3]
PROGRAM = Path(__file__).with_name("agent_process.py")
PATIENCE_S = 30.0
WAIT_S = 3600.0
"""Longer than any job here [s]."""


CLIENT = Client("r", 1)
WORK = Evaluate(BirthId(0, 0), Robot((Part("Core", -1, -1, -1, 0, ()),)))


def request(
    number: int, *, settings: bytes = b"", epoch: int = 1, plugins: str = ""
) -> bytes:
    return encode(Request("r", epoch, number, WORK, settings, plugins))


def read_answer(data: bytes) -> Answer:
    return decode(Answer, data, ANSWER_BYTES)


@pytest.fixture
def network() -> Iterator[Network]:
    with Network(name="c") as network:
        yield network


@contextmanager
def agent(
    network: Network, name: str, behaviour: str = "good", role: str = "worker"
) -> Iterator[subprocess.Popen[str]]:
    """Run an agent; its standard input stays open, so that it can wait for a line."""
    command = [sys.executable, str(PROGRAM), role, name, network.address, behaviour]
    with subprocess.Popen(
        command,
        env={**os.environ, "PYTHONPATH": str(ROOT)},
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    ) as process:
        try:
            yield process
        finally:
            process.kill()


def until(
    network: Network, is_enough: Callable[[list[DispatchEvent]], bool]
) -> list[DispatchEvent]:
    """Return all events until a condition holds."""
    events: list[DispatchEvent] = []
    end_s = time.monotonic() + PATIENCE_S
    while not is_enough(events):
        assert time.monotonic() < end_s, events
        events += network.receive(0.2)
    return events


def has(count: int) -> Callable[[list[DispatchEvent]], bool]:
    return lambda events: len(events) >= count


def send(network: Network, name: str, *numbers: int, wait_s: float = WAIT_S) -> None:
    """Send jobs to an agent, together and at once."""
    for number in numbers:
        network.send(number, name, request(number), wait_s)
    # An agent of a loaded machine may tell late that it computed.
    assert {type(event) for event in network.receive(0.0)} <= {Progressed}


def line_of(process: subprocess.Popen[str]) -> str:
    assert process.stdout is not None
    return process.stdout.readline()


def go_on(process: subprocess.Popen[str], jobs: int = 1) -> None:
    """Let a slow agent end some jobs."""
    assert process.stdin is not None
    process.stdin.write("on\n" * jobs)
    process.stdin.flush()


def ask(fleet: JobRouter, count: int) -> list[int]:
    """Request jobs; return their numbers."""
    numbers = [fleet.new_number() for _ in range(count)]
    for number in numbers:
        payload = request(number)
        fleet.request(Job(number, "evaluate", payload, client=CLIENT, read=read_answer))
    return numbers


def listen(fleet: JobRouter, is_enough: Callable[[], bool]) -> dict[int, str]:
    """Return the agents of all jobs that are delivered until a condition holds."""
    agents: dict[int, str] = {}
    end_s = time.monotonic() + PATIENCE_S
    while not is_enough():
        now_s = time.monotonic()
        assert now_s < end_s, agents
        for end in fleet.listen(0.05, now_s).get(CLIENT, ()):
            assert end.job.number not in agents
            assert isinstance(end.answer, Answer)
            assert end.answer.number == end.job.number
            agents[end.job.number] = end.agent
    return agents


def test_each_job_is_delivered_once_by_two_workers(
    network: Network, monkeypatch: pytest.MonkeyPatch
) -> None:
    keep, kept = ctypes.pythonapi.PyGILState_Ensure, []
    monkeypatch.setattr(
        ctypes.pythonapi, "PyGILState_Ensure", lambda: kept.append(keep())
    )
    # An earlier test may have kept the states of the engine's threads.
    monkeypatch.setattr("coordinator.network.service._THREAD", threading.local())
    fleet = JobRouter(network)
    with agent(network, "a"), agent(network, "b"):
        listen(fleet, lambda: fleet.dispatch.agents("worker") == 2)
        numbers = ask(fleet, 500)
        agents = listen(fleet, lambda: not fleet.dispatch.pending)
    assert sorted(agents) == numbers
    assert set(agents.values()) == {"a", "b"}
    # Once for each thread of the engine, not for each answer.
    assert 1 <= len(kept) < 50


def test_jobs_of_a_killed_worker_are_done_by_another(network: Network) -> None:
    fleet = JobRouter(network)
    numbers = ask(fleet, 3)
    with agent(network, "a", "stuck") as process:
        listen(fleet, lambda: fleet.dispatch.waiting("worker") == 1)
        assert not fleet.listen(0.0, time.monotonic())  # sends what is assigned
        assert line_of(process) == "begun\n"
        process.send_signal(signal.SIGKILL)
        with agent(network, "b"):
            agents = listen(fleet, lambda: not fleet.dispatch.pending)
    assert agents == dict.fromkeys(numbers, "b")


def test_only_a_job_that_computes_reports_progress(network: Network) -> None:
    with agent(network, "busy", "busy") as busy, agent(network, "stuck", "stuck") as it:
        until(network, has(2))
        config = zenoh.Config.from_json5(client_config(network.address))
        with zenoh.open(config) as session:

            def quiet_s(name: str) -> float:
                (reply,) = session.get(FleetMember("default", "worker", name).info)
                assert reply.ok is not None
                data = reply.ok.payload.to_bytes()
                quiet_s = decode(AgentInfo, data, INFO_BYTES).quiet_s
                return -1.0 if quiet_s is None else quiet_s

            assert quiet_s("busy") == quiet_s("stuck") == -1.0
            for process, name in ((busy, "busy"), (it, "stuck")):
                send(network, name, 0)
                assert line_of(process) == "begun\n"
            wait_until(lambda: quiet_s("stuck") > LONGEST_QUIET_S, "quiet", PATIENCE_S)
            assert 0.0 <= quiet_s("busy") <= LONGEST_QUIET_S
        network.ask("stuck")
        network.ask("nobody")
        network.ask("busy")
        assert until(network, has(1)) == [Progressed("busy")]
        assert network.receive(0.5) == []
        assert network.faults.total("malformed") == 0


def test_a_worker_told_to_end_finishes_its_job_and_drops_the_next(
    network: Network,
) -> None:
    with agent(network, "w", "slow") as process:
        until(network, has(1))
        send(network, "w", 0, 1)
        assert line_of(process) == "begun\n"
        process.terminate()
        go_on(process)
        events = until(network, has(3))
        assert process.wait(PATIENCE_S) == 0
    outcomes = {e.number: e.outcome for e in events if isinstance(e, Returned)}
    assert outcomes == {0: "ok", 1: "lost"}
    assert Left("w") in events


@pytest.mark.slow
def test_suspended_worker_leaves_and_joins_again_when_resumed(network: Network) -> None:
    with agent(network, "w") as process:
        joined = until(network, has(1))
        process.send_signal(signal.SIGSTOP)
        network.send(0, "w", request(0), WAIT_S)
        gone = until(network, has(2))
        assert Left("w") in gone
        assert Returned(0, "w", "lost") in gone
        process.send_signal(signal.SIGCONT)
        assert until(network, has(1)) == joined


def test_a_job_without_a_reply_expires_after_its_wait(network: Network) -> None:
    with agent(network, "w", "stuck"):
        until(network, has(1))
        network.send(0, "w", request(0), 0.5)
        (event,) = until(network, has(1))
        assert isinstance(event, Returned)
        assert (event.number, event.agent, event.outcome) == (0, "w", "expired")
        assert event.took_s is not None
        assert 0.4 < event.took_s < PATIENCE_S


def test_a_long_job_that_is_asked_for_again_is_done_once(
    network: Network, capfd: pytest.CaptureFixture[str]
) -> None:
    with agent(network, "w", "long") as process:
        until(network, has(1))
        capfd.readouterr()  # an agent that starts slowly answers an old question
        send(network, "w", 0, wait_s=0.5)
        assert line_of(process) == "begun\n"
        (event,) = until(network, has(1))
        assert isinstance(event, Returned)
        assert event.outcome == "expired"
        send(network, "w", 0, 1)
        go_on(process, 2)
        events = until(network, has(2))
        process.terminate()
        assert process.stdout is not None
        assert process.stdout.read().count("begun") == 1
    told = [(e.number, e.outcome) for e in events if isinstance(e, Returned)]
    assert told == [(0, "ok"), (1, "ok")]
    # It is no fault: the engine writes nothing about it.
    assert capfd.readouterr() == ("", "")


def test_the_memory_of_requests_is_free_after_their_wait(network: Network) -> None:
    """The engine holds half a kilobyte of each until then."""
    with agent(network, "w"):
        until(network, has(1))
        held_kb = []
        for turn in range(6):
            for number in range(2000):
                network.send(2000 * turn + number, "w", request(number), 0.02)
                until(network, has(1))
            status = Path("/proc/self/status").read_text()
            (line,) = [each for each in status.splitlines() if "RssAnon" in each]
            held_kb.append(int(line.split()[1]))
        # With the longest wait each turn would take more than 1,200 kB.
        growth_kb = [later - before for before, later in pairwise(held_kb)]
        assert median(growth_kb) < 300


def test_cancelled_job_is_not_done(network: Network) -> None:
    with agent(network, "w", "slow") as process:
        until(network, has(1))
        send(network, "w", 0)
        # What is sent in this order arrives in it.
        network.cancel("w", request(1))
        send(network, "w", 1)
        network.cancel("nobody", request(1))
        assert line_of(process) == "begun\n"
        go_on(process)
        events = until(network, has(2))
    told = {e.number: e.outcome for e in events if isinstance(e, Returned)}
    assert told == {0: "ok", 1: "cancelled"}


def test_workers_connect_to_a_new_coordinator() -> None:
    with Network(name="c1") as first, agent(first, "w"):
        until(first, has(1))
        first.__exit__(None, None, None)
        with Network(name="c2", listen=(first.address,)) as second:
            assert until(second, has(1)) == [Joined("w", "worker", 1, "p")]


def test_bad_requests_are_refused_and_the_next_one_served(network: Network) -> None:
    refused = [
        (b"\xff\xff", "error", "damaged, or of another version"),
        (b"", "error", "damaged, or of another version"),
        (request(0, settings=b"bad"), "error", "settings: bad"),
        (request(0, settings=b"bug"), "error", "ZeroDivisionError: a plug-in's own"),
        (request(0, plugins="not_here=a"), "unfit", "has no plug-in 'not_here' among"),
    ]
    with agent(network, "w"):
        until(network, has(1))
        for number, (payload, outcome, reason) in enumerate(refused):
            network.send(number, "w", payload, WAIT_S)
            (refusal,) = until(network, has(1))
            assert isinstance(refusal, Returned)
            assert (refusal.number, refusal.outcome) == (number, outcome)
            assert reason in refusal.reason
        network.send(9, "w", request(9), WAIT_S)
        (answer,) = until(network, has(1))
    assert isinstance(answer, Returned)
    assert read_answer(answer.answer).number == 9


@pytest.mark.parametrize("others", range(8))
def test_no_message_is_dropped_behind_many_without_an_event(
    network: Network, monkeypatch: pytest.MonkeyPatch, others: int
) -> None:
    monkeypatch.setattr("coordinator.network.service._MOST_NEWS", 3)
    for _ in range(others):
        network.wake()
    network.send(7, "nobody", request(7), WAIT_S)
    found = [event for _ in range(4) for event in network.receive(0.0)]
    assert found == [Returned(7, "nobody", "lost")]


def test_an_agent_of_another_version_is_refused(network: Network) -> None:
    with agent(network, "a", "old"):
        until(network, lambda _: bool(network.refused))
    assert "'another'" in network.refused["a"]


@pytest.mark.parametrize(
    "info",
    [
        b"\xff\xff",
        b"",
        encode(AgentInfo("x", "worker", 0, "p", "1")),
        encode(AgentInfo("y", "worker", 1, "p", "1")),
    ],
)
def test_a_malformed_message_is_counted_and_dropped(
    network: Network, info: bytes
) -> None:
    peer = FleetMember("default", "worker", "x")

    def tell(query: zenoh.Query) -> None:
        with query:
            query.reply(peer.info, info)

    config = session_config(client_config(network.address), peer)
    with zenoh.open(config) as session:
        told = zenoh.handlers.Callback(tell)
        with (
            session.declare_queryable(peer.info, told, complete=True),
            session.liveliness().declare_token(peer.alive),
        ):
            assert until(network, lambda _: network.faults.total("malformed") > 0) == []
            assert network.faults.total("malformed") == 1
            with agent(network, "w"):
                assert until(network, has(1)) == [Joined("w", "worker", 1, "p")]


def test_port_in_use_is_reported_in_one_line(network: Network) -> None:
    with (
        pytest.raises(NetworkError, match=r"^cannot listen on .*: it is in use; "),
        Network(name="d", listen=(network.address,)),
    ):
        pass


def test_two_coordinators_share_a_hub_and_its_workers(network: Network) -> None:
    with agent(network, "w"), Network(name="d", connect=network.address) as other:
        for coordinator in (network, other):
            assert until(coordinator, has(1)) == [Joined("w", "worker", 1, "p")]
            coordinator.send(3, "w", request(3), WAIT_S)
            (returned,) = until(coordinator, has(1))
            assert isinstance(returned, Returned)
            assert returned.outcome == "ok"
            assert returned.took_s is not None
            assert 0.0 < returned.took_s < PATIENCE_S


@pytest.mark.parametrize("end", ["stat$*", "*", "comman$*", "c$*"])
def test_a_query_with_a_wildcard_gets_a_reply_of_each_key(
    network: Network, end: str
) -> None:
    """The reply to such a query must not be on another key: that is an error."""
    member = FleetMember("default", "coordinator", "c")
    config = zenoh.Config.from_json5(client_config(network.address))
    key = member.command.replace("/command", f"/{end}")
    pattern = key.replace("$", "")
    keys = {each for each in (member.command, member.state) if fnmatch(each, pattern)}
    with zenoh.open(config) as session:
        replies = session.get(key, consolidation=zenoh.ConsolidationMode.NONE)
        asked: list[OperatorQuery] = []
        while len(asked) < len(keys):
            network.receive(0.1)
            asked += network.queries.orders() + network.queries.onlookers()
        for order in asked:
            order.reply(b"yes")
        found = {str(reply.ok.key_expr) for reply in replies if reply.ok}
    assert found == keys


def test_a_query_of_hostile_length_is_counted_and_dropped(network: Network) -> None:
    member = FleetMember("default", "coordinator", "c")
    config = zenoh.Config.from_json5(client_config(network.address))
    with zenoh.open(config) as session:
        replies = session.get(member.command, payload=bytes(OPERATOR_REQUEST_BYTES + 1))
        until(network, lambda _: network.faults.total("malformed") > 0)
        assert list(replies) == []
    assert network.queries.orders() == []


def test_a_hub_without_a_coordinator_of_the_fleet_is_told(network: Network) -> None:
    expected = ": no coordinator of fleet other replies$"
    with (
        asking(network.address, fleet="other", tls=None) as ask,
        pytest.raises(NetworkError, match=expected),
    ):
        ask(b"")


def test_replies_of_a_liar_end_each_of_its_jobs_once(network: Network) -> None:
    peer = FleetMember("default", "worker", "x")
    replies = (
        encode([Reply(1, b"first")]),
        encode([Reply(1, b"second"), Reply(7, b"of no job"), Reply(2, reason="no")]),
        b"malformed",
        encode([Reply(0, b"beyond the number of jobs")]),
    )

    def lie(query: zenoh.Query) -> None:
        with query:
            for each in replies:
                query.reply(peer.jobs, each)

    with zenoh.open(session_config(client_config(network.address), peer)) as session:
        jobs = session.declare_queryable(peer.jobs, lie, complete=True)
        info = introduce(session, peer)
        token = session.liveliness().declare_token(peer.alive)
        until(network, has(1))
        for number in (5, 6, 7):
            network.send(number, "x", request(number), WAIT_S)
        returned = until(network, has(3))
        until(network, lambda _: network.faults.total("late") == 3)
        for each in (jobs, info, token):
            each.undeclare()
    ends = {each.number: each for each in returned if isinstance(each, Returned)}
    assert [ends[n].outcome for n in (5, 6, 7)] == ["ok", "ok", "error"]
    assert (ends[6].answer, ends[7].reason) == (b"first", "no")
    with pytest.raises(MalformedMessage):
        read_answer(ends[5].answer)
