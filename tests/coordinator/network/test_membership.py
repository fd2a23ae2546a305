"""Membership of agents: tokens and introductions in, events out."""

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from coordinator.dispatch.events import Died, Joined, Left, Progressed
from coordinator.network.membership import (
    LONGEST_QUIET_S,
    MOST_CORES,
    MOST_SHARDS,
    MOST_SLOTS,
    Membership,
)
from schema.agent.topics import Member
from schema.errors import MalformedMessage
from schema.wire import revolve_pb2 as pb

WORKER = Member("f", "worker", "w")


def info(
    agent: str = "w",
    kind: str = "worker",
    slots: int = 2,
    version: str = "1",
    *,
    shards: int = 3,
    cores: int = 4,
    quiet_s: float | None = None,
) -> bytes:
    message = pb.AgentInfo(
        agent=agent, kind=kind, slots=slots, platform="p", version=version,
        shards=shards, cores=cores, quiet_s=quiet_s,
    )  # fmt: skip
    return message.SerializeToString()


@pytest.fixture
def membership() -> Membership:
    membership = Membership("1")
    assert membership.appear(WORKER.alive) == WORKER
    return membership


def test_agent_joins_with_its_info_and_leaves(membership: Membership) -> None:
    assert membership.is_stranger("w")
    assert membership.introduce("w", info()) == [Joined("w", "worker", 2, "p", 3, 4)]
    assert not membership.is_stranger("w")
    assert membership.appear(WORKER.alive) is None
    assert membership.vanish(WORKER.alive) == Left("w")
    assert "w" not in membership.members


def test_unknown_agent_that_vanishes_gives_no_event(membership: Membership) -> None:
    assert membership.vanish(WORKER.alive) is None
    assert not membership.is_stranger("w")
    # A thawed one stands there again under the same token.
    assert membership.appear(WORKER.alive) == WORKER
    assert membership.introduce("w", info()) != []


def test_agent_of_another_version_is_refused_until_it_vanishes(
    membership: Membership,
) -> None:
    assert membership.introduce("w", info(version="2")) == []
    assert membership.refused == {"w": "is of version '2', the coordinator of '1'"}
    assert not membership.is_stranger("w")
    assert membership.vanish(WORKER.alive) is None
    assert membership.refused == {}


def test_refused_agent_joins_again_only_after_it_vanished(
    membership: Membership,
) -> None:
    assert membership.refuse("w", "too early") is None
    membership.introduce("w", info())
    assert membership.refuse("w", "has no plug-in") == Left("w")
    assert membership.refused == {"w": "has no plug-in"}
    assert membership.refuse("w", "told twice") is None
    assert not membership.is_stranger("w")
    assert membership.vanish(WORKER.alive) is None
    assert (membership.refused, membership.members) == ({}, {})


def test_each_death_is_reported_once_and_before_the_successor_joins(
    membership: Membership,
) -> None:
    message = pb.AgentInfo.FromString(info())
    message.deaths.add(agent="v", run="r", epoch=3, number=7, cause="SIGSEGV")
    joined = Joined("w", "worker", 2, "p", 3, 4)
    told = membership.introduce("w", message.SerializeToString())
    assert told == [Died("r", 3, 7, "v", "SIGSEGV"), joined]
    membership.vanish(WORKER.alive)
    membership.appear(WORKER.alive)
    message.deaths.add(agent="u", run="r", epoch=3, number=7, cause="x" * 999)
    told = membership.introduce("w", message.SerializeToString())
    assert told == [Died("r", 3, 7, "u", "x" * 100), joined]


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
    ],
)
def test_false_info_is_malformed_and_changes_nothing(
    membership: Membership, data: bytes
) -> None:
    with pytest.raises(MalformedMessage):
        membership.introduce("w", data)
    assert membership.is_stranger("w")


@settings(derandomize=True)
@given(st.binary(max_size=64))
def test_any_bytes_introduce_or_are_malformed(data: bytes) -> None:
    membership = Membership("1")
    membership.appear(WORKER.alive)
    try:
        membership.introduce("w", data)
    except MalformedMessage:
        assert membership.is_stranger("w")


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
    assert membership.progress("w", data) is None
    membership.introduce("w", info())
    expected = Progressed("w") if works else None
    assert membership.progress("w", data) == expected
    with pytest.raises(MalformedMessage):
        membership.progress("w", info(agent="x", quiet_s=0.0))
    membership.vanish(WORKER.alive)
    assert membership.progress("w", data) is None
