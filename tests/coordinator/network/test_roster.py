"""Who is there: tokens and introductions in, news out."""

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from coordinator.dispatch.events import Died, Joined, Left
from coordinator.network.roster import Roster
from schema.agent.topics import Member
from schema.errors import MalformedMessage
from schema.wire import revolve_pb2 as pb

WORKER = Member("f", "worker", "w")


def info(
    agent: str = "w", kind: str = "worker", slots: int = 2, version: str = "1"
) -> bytes:
    message = pb.AgentInfo(
        agent=agent, kind=kind, slots=slots, platform="p", version=version
    )
    return message.SerializeToString()


@pytest.fixture
def roster() -> Roster:
    roster = Roster("1")
    assert roster.appear(WORKER.alive) == WORKER
    return roster


def test_an_agent_joins_by_saying_what_it_is_and_leaves(roster: Roster) -> None:
    assert roster.is_stranger("w")
    assert roster.introduce("w", info()) == [Joined("w", "worker", 2, "p")]
    assert not roster.is_stranger("w")
    assert roster.appear(WORKER.alive) is None
    assert roster.vanish(WORKER.alive) == Left("w")
    assert roster.find("w") is None


def test_who_vanishes_unknown_is_no_news(roster: Roster) -> None:
    assert roster.vanish(WORKER.alive) is None
    assert not roster.is_stranger("w")
    # A thawed one stands there again under the same token.
    assert roster.appear(WORKER.alive) == WORKER
    assert roster.introduce("w", info()) != []


def test_another_version_is_refused_until_it_goes(roster: Roster) -> None:
    assert roster.introduce("w", info(version="2")) == []
    assert roster.refused == {"w": "is of version '2', the coordinator of '1'"}
    assert not roster.is_stranger("w")
    assert roster.vanish(WORKER.alive) is None
    assert roster.refused == {}


def test_who_is_refused_takes_no_more_part_until_it_comes_again(roster: Roster) -> None:
    assert roster.refuse("w", "too early") is None
    roster.introduce("w", info())
    assert roster.refuse("w", "has no plug-in") == Left("w")
    assert roster.refused == {"w": "has no plug-in"}
    assert roster.refuse("w", "told twice") is None
    assert not roster.is_stranger("w")
    assert roster.vanish(WORKER.alive) is None
    assert (roster.refused, roster.find("w")) == ({}, None)


def test_each_death_is_told_once_and_before_who_took_the_place(roster: Roster) -> None:
    message = pb.AgentInfo.FromString(info())
    message.deaths.add(agent="v", run="r", epoch=3, number=7, cause="SIGSEGV")
    joined = Joined("w", "worker", 2, "p")
    told = roster.introduce("w", message.SerializeToString())
    assert told == [Died("r", 3, 7, "v", "SIGSEGV"), joined]
    roster.vanish(WORKER.alive)
    roster.appear(WORKER.alive)
    message.deaths.add(agent="u", run="r", epoch=3, number=7, cause="x" * 999)
    told = roster.introduce("w", message.SerializeToString())
    assert told == [Died("r", 3, 7, "u", "x" * 100), joined]


@pytest.mark.parametrize(
    "data", [b"", b"\xff", info(agent="x"), info(kind="analyzer"), info(slots=0)]
)
def test_a_lie_is_malformed_and_changes_nothing(roster: Roster, data: bytes) -> None:
    with pytest.raises(MalformedMessage):
        roster.introduce("w", data)
    assert roster.is_stranger("w")


@settings(derandomize=True)
@given(st.binary(max_size=64))
def test_any_bytes_introduce_or_are_malformed(data: bytes) -> None:
    roster = Roster("1")
    roster.appear(WORKER.alive)
    try:
        roster.introduce("w", data)
    except MalformedMessage:
        assert roster.is_stranger("w")


@pytest.mark.parametrize("key", ["", "revolve/f/w/alive", "revolve/f/x/w/alive"])
def test_no_token(roster: Roster, key: str) -> None:
    for take in (roster.appear, roster.vanish):
        with pytest.raises(MalformedMessage):
            take(key)
