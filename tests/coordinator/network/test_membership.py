"""Membership of agents: tokens and introductions in, events out; order of asking."""

from typing import Any

import pytest
from msgspec.structs import replace

from coordinator.dispatch.events import Joined, Left, Progressed
from coordinator.dispatch.faults import PeerFaults
from coordinator.network.membership import LONGEST_PAUSE_S, SHARE, InfoQueue, Membership
from schema.agent.topics import FleetMember
from schema.errors import MalformedMessage
from schema.limits import (
    INFO_BYTES,
    LONGEST_QUIET_S,
    MOST_CORES,
    MOST_DEATHS,
    MOST_MEMBERS,
    MOST_PEERS,
    MOST_SHARDS,
    MOST_SLOTS,
)
from schema.wire.codec import encode
from schema.wire.messages import AgentInfo, Crash, RunningJob

WORKER = FleetMember("f", "worker", "host-0.w")
NAME = WORKER.name


INFO = AgentInfo(NAME, "worker", 2, "p", "1", shards=3, cores=4)


def info(**changes: Any) -> bytes:  # noqa: ANN401 - of any field
    return encode(replace(INFO, **changes))


def joined(name: str) -> Joined:
    return Joined(name, "worker", 2, "p", 3, 4)


@pytest.fixture
def faults() -> PeerFaults:
    return PeerFaults()


@pytest.fixture
def membership(faults: PeerFaults) -> Membership:
    membership = Membership("1", faults)
    assert membership.appear(WORKER.alive) == WORKER
    return membership


def test_agent_joins_with_its_info_and_leaves(membership: Membership) -> None:
    assert membership.is_stranger(WORKER)
    assert membership.introduce(WORKER, info()) == [joined(NAME)]
    assert not membership.is_stranger(WORKER)
    assert membership.appear(WORKER.alive) is None
    assert membership.vanish(WORKER.alive) == Left(NAME)
    assert NAME not in membership.joined


def test_unknown_agent_that_vanishes_gives_no_event(membership: Membership) -> None:
    assert membership.vanish(WORKER.alive) is None
    assert not membership.is_stranger(WORKER)
    # A thawed one stands there again under the same token.
    assert membership.appear(WORKER.alive) == WORKER
    assert membership.introduce(WORKER, info()) != []


def test_agent_of_another_version_is_refused_until_it_vanishes(
    membership: Membership,
) -> None:
    assert membership.introduce(WORKER, info(version="2")) == []
    assert membership.refused == {NAME: "is of version '2', the coordinator of '1'"}
    assert not membership.is_stranger(WORKER)
    assert membership.vanish(WORKER.alive) is None
    assert membership.refused == {}


def with_death(member: FleetMember, of: str, cause: str = "SIGSEGV") -> bytes:
    crash = Crash(RunningJob(of, "r", 3, 7, bytes(8)), cause)
    return info(agent=member.name, kind=member.role, deaths=(crash,))


def successor(member: FleetMember, letter: str) -> FleetMember:
    return FleetMember("f", member.role, f"host-0.{letter}")


def test_each_death_is_reported_once_and_before_the_successor_joins(
    membership: Membership,
) -> None:
    membership.introduce(WORKER, info())
    membership.vanish(WORKER.alive)
    second, third = successor(WORKER, "x"), successor(WORKER, "y")
    for member in (second, third):
        membership.appear(member.alive)
    cause = "SIG\x1b[31m" + "x" * 999
    (died, after) = membership.introduce(second, with_death(second, NAME, cause))
    assert isinstance(died, Crash)
    assert died.job == RunningJob(NAME, "r", 3, 7, bytes(8))
    assert len(died.cause) == 100
    assert died.cause.isprintable()
    assert after == joined(second.name)
    assert membership.introduce(third, with_death(third, NAME)) == [joined(third.name)]


@pytest.mark.parametrize("state", ["unknown", "alive", "of another slot"])
def test_a_death_that_did_not_happen_is_dropped(
    membership: Membership, faults: PeerFaults, state: str
) -> None:
    if state != "unknown":
        membership.introduce(WORKER, info())
    if state == "of another slot":
        membership.vanish(WORKER.alive)
        liar = FleetMember("f", "worker", "host-1.x")
    else:
        liar = successor(WORKER, "x")
    membership.appear(liar.alive)
    events = membership.introduce(liar, with_death(liar, NAME))
    assert events == [joined(liar.name)]
    # An earlier coordinator may have known an unknown one.
    assert faults.total("death") == (state != "unknown")


def test_a_token_counts_only_under_its_own_roles_prefix(membership: Membership) -> None:
    forged = FleetMember("f", "analyzer", NAME)
    membership.introduce(WORKER, info())
    assert membership.appear(forged.alive) == forged
    assert membership.vanish(forged.alive) is None
    assert membership.joined[NAME] == WORKER
    membership.appear(forged.alive)
    with pytest.raises(MalformedMessage, match="another agent's name"):
        membership.introduce(forged, info(kind="analyzer"))
    assert membership.vanish(forged.alive) is None
    assert membership.vanish(WORKER.alive) == Left(NAME)


def test_a_forged_token_that_came_first_does_not_keep_the_worker_out(
    faults: PeerFaults,
) -> None:
    membership = Membership("1", faults)
    membership.appear(FleetMember("f", "analyzer", NAME).alive)
    assert membership.appear(WORKER.alive) == WORKER
    assert membership.introduce(WORKER, info()) == [joined(NAME)]


def test_agents_that_do_not_answer_make_room_for_others(
    membership: Membership, faults: PeerFaults
) -> None:
    membership.introduce(WORKER, info())
    for number in range(3 * MOST_MEMBERS):
        fake = FleetMember("f", "worker", f"fake{number}")
        assert membership.appear(fake.alive) == fake
        membership.note_silence(fake)
    assert len(membership) == MOST_MEMBERS
    assert faults.total("crowd") == 2 * MOST_MEMBERS + 1
    assert len(faults.counts) <= MOST_PEERS + 1
    late = FleetMember("f", "worker", "host-0.late")
    assert membership.appear(late.alive) == late
    data = info(agent=late.name)
    assert membership.introduce(late, data) == [joined(late.name)]
    assert membership.joined[NAME] == WORKER


def test_an_agent_that_stops_answering_leaves_and_may_join_again(
    membership: Membership,
) -> None:
    """A token stays while another process declares the same one."""
    membership.introduce(WORKER, info())
    assert membership.note_silence(WORKER) == Left(NAME)
    assert membership.note_silence(WORKER) is None
    assert membership.silences(WORKER) == 2
    assert membership.introduce(WORKER, info()) == [joined(NAME)]
    assert membership.silences(WORKER) == 0


@pytest.mark.parametrize(
    "data",
    [
        b"",
        b"\xff",
        info(agent="x"),
        info(kind="analyzer"),
        info(slots=0),
        info(slots=MOST_SLOTS + 1),
        info(shards=0),
        info(shards=MOST_SHARDS + 1),
        info(cores=0),
        info(cores=MOST_CORES + 1),
        info(slots=2**32 - 1),
        info() + b"\0",
        info(version="1" * INFO_BYTES),
        info(platform="p" * 1000),
        info(platform="\x1b[2J"),
        info(
            deaths=(Crash(RunningJob(NAME, "r", 1, 1), "SIGSEGV"),) * (MOST_DEATHS + 1)
        ),
    ],
)
def test_false_info_is_malformed_and_changes_nothing(
    membership: Membership, data: bytes
) -> None:
    with pytest.raises(MalformedMessage):
        membership.introduce(WORKER, data)
    assert membership.is_stranger(WORKER)


@pytest.mark.parametrize("key", ["", "revolve/f/w/alive", "revolve/f/x/w/alive"])
def test_other_keys_are_malformed(membership: Membership, key: str) -> None:
    for take in (membership.appear, membership.vanish):
        with pytest.raises(MalformedMessage):
            take(key)


@pytest.mark.parametrize(
    ("quiet_s", "works"),
    [
        (0.0, True),
        (LONGEST_QUIET_S, True),
        (LONGEST_QUIET_S + 0.1, False),
        (None, False),
        (-1.0, False),
        (float("nan"), False),
    ],
)
def test_agent_reports_progress_if_its_job_used_cpu_lately(
    membership: Membership, quiet_s: float | None, works: object
) -> None:
    data = info(quiet_s=quiet_s)
    assert membership.progress(WORKER, data) is None
    membership.introduce(WORKER, info())
    expected = Progressed(NAME) if works else None
    assert membership.progress(WORKER, data) == expected
    with pytest.raises(MalformedMessage):
        membership.progress(WORKER, info(agent="x", quiet_s=0.0))
    membership.vanish(WORKER.alive)
    assert membership.progress(WORKER, data) is None


def member(name: str) -> FleetMember:
    return FleetMember("f", "worker", name)


def due(queue: InfoQueue, now_s: float) -> FleetMember | None:
    """Return the agent that is to be asked at a time, if there is one."""
    return queue.take() if now_s >= queue.due_s else None


def test_the_newest_and_the_oldest_agent_are_asked_in_turn() -> None:
    queue = InfoQueue()
    queue.add_again(member("silent"), 1, 0.0)
    for name in ("a", "b", "c"):
        queue.add(member(name))
    names = [taken.name for _ in range(4) if (taken := due(queue, 5.0))]
    assert names == ["c", "a", "b", "silent"]
    assert due(queue, 5.0) is None


def test_pauses_grow_with_each_silence_up_to_a_limit() -> None:
    for silences, pause_s in ((1, 1.0), (2, 2.0), (4, 8.0), (1000, LONGEST_PAUSE_S)):
        queue = InfoQueue()
        queue.add_again(member("a"), silences, 10.0)
        assert due(queue, 10.0 + 0.99 * pause_s) is None
        assert due(queue, 10.0 + pause_s) == member("a")


def test_asking_takes_a_limited_share_of_the_time() -> None:
    queue = InfoQueue()
    for number in range(10_000):
        queue.add(member(f"fake{number}"))
    now_s = spent_s = 0.0
    while now_s < 10.0:
        if due(queue, now_s) is None:
            now_s += 0.001
            continue
        queue.spent(now_s, now_s + 0.003)
        now_s += 0.003
        spent_s += 0.003
    assert 0.5 * SHARE < spent_s / now_s <= SHARE + 0.001
