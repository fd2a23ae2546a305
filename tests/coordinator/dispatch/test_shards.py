"""Assignment of shards to workers, event by event."""

from collections import Counter
from itertools import count
from typing import NamedTuple

import pytest

from coordinator.dispatch.dispatch import Dispatch
from coordinator.dispatch.events import (
    AskProgress,
    Assign,
    Cancel,
    Crowded,
    Deliver,
    DispatchEvent,
    Job,
    Joined,
    Left,
    Outcome,
    Overdue,
    Progressed,
    Requested,
    Returned,
    ShardSeen,
    Ticked,
)
from coordinator.dispatch.homes import DRIFT_S, LEAST_S
from coordinator.dispatch.pool import FIRST_S, PATIENCE, REPLY_S
from schema.errors import UnexpectedEvent


class Sent(NamedTuple):
    """An advance that is assigned."""

    number: int
    shard: int
    agent: str
    platform: str
    is_whole: bool


class Cancelled(NamedTuple):
    """An advance that its agent need not make any more."""

    number: int
    shard: int
    agent: str


class Ended(NamedTuple):
    """An advance that was made, or was given up for a reason."""

    shard: int
    agent: str
    reason: str = ""


Command = Sent | Cancelled | Ended | AskProgress | Overdue | Crowded


def joined(name: str, platform: str = "p", kind: str = "worker") -> Joined:
    return Joined(name, kind, 1, platform, shards=16)  # type: ignore[arg-type]


class Fleet:
    """A dispatcher that is only asked for advances; its commands in short."""

    def __init__(self, *, allows_drift: bool = False) -> None:
        self._numbers = count(1)
        self._dispatch = Dispatch(self._numbers, allows_drift=allows_drift)
        self.homes = self._dispatch.homes
        self.holder = self.homes.holder
        self._agents: dict[int, str] = {}

    def handle(self, event: DispatchEvent) -> list[Command]:
        return [self._short(command) for command in self._dispatch.handle(event)]

    def assign(self, shard: int) -> Sent:
        """Request an advance, which is assigned; return it."""
        (sent,) = self.request(shard)
        assert isinstance(sent, Sent)
        return sent

    def request(self, shard: int, simulated_s: float | None = None) -> list[Command]:
        number = next(self._numbers)
        job = Job(number, "advance", simulated_s=simulated_s, shard=shard)
        return self.handle(Requested(job))

    def returned(
        self, number: int, outcome: Outcome = "ok", reason: str = ""
    ) -> list[Command]:
        agent = self._agents[number]
        return self.handle(Returned(number, agent, outcome, reason=reason))

    def _short(self, command: object) -> Command:
        match command:
            case Assign(job, agent, platform, is_whole):
                self._agents[job.number] = agent
                return Sent(job.number, job.shard, agent, platform, is_whole)
            case Cancel(job, agent):
                return Cancelled(job.number, job.shard, agent)
            case Deliver(job, agent, reason=reason):
                return Ended(job.shard, agent, reason)
        assert isinstance(command, AskProgress | Overdue | Crowded)
        return command

    @property
    def waiting(self) -> dict[int, str]:
        return self.homes.waiting

    @property
    def wake_s(self) -> float | None:
        return self._dispatch.wake_s


def fleet(*names: str) -> Fleet:
    dispatch = Fleet()
    for name in names:
        assert dispatch.handle(joined(name)) == []
    return dispatch


def test_only_a_worker_of_the_first_platform_continues_a_shard() -> None:
    dispatch = fleet()
    dispatch.handle(joined("b", "arm"))
    dispatch.handle(joined("a", "arm"))
    assert dispatch.request(0) == [Sent(1, 0, "a", "arm", is_whole=True)]
    with pytest.raises(UnexpectedEvent, match="requested already"):
        dispatch.request(0)
    assert dispatch.returned(1) == [Ended(0, "a")]
    assert dispatch.request(0) == [Sent(3, 0, "a", "arm", is_whole=False)]
    dispatch.returned(3)
    for name in "ab":
        assert dispatch.handle(Left(name)) == []
    dispatch.handle(joined("c", "x86"))
    assert dispatch.request(0) == []
    assert dispatch.waiting == {0: "arm"}
    whole = Sent(4, 0, "d", "arm", is_whole=True)
    assert dispatch.handle(joined("d", "arm")) == [whole]


def drifting(*, allows_drift: bool = True, may_drift: bool = True) -> Fleet:
    """Return a shard dispatcher whose shard ran on a platform that has left."""
    dispatch = Fleet(allows_drift=allows_drift)
    dispatch.handle(ShardSeen(0, "theirs", may_drift))
    dispatch.handle(joined("b", "ours"))
    dispatch.handle(joined("a", "ours"))
    assert dispatch.request(0) == []
    assert dispatch.handle(Ticked(100.0)) == []
    assert dispatch.waiting == {0: "theirs"}
    return dispatch


def test_shard_drifts_to_another_platform_after_a_while_if_allowed() -> None:
    dispatch = drifting()
    assert dispatch.wake_s == 100.0 + DRIFT_S
    assert dispatch.handle(Ticked(99.9 + DRIFT_S)) == []
    whole = Sent(1, 0, "a", "ours", is_whole=True)
    assert dispatch.handle(Ticked(100.0 + DRIFT_S)) == [whole]
    dispatch.returned(1)
    # It is at home there now.
    dispatch.handle(joined("c", "theirs"))
    assert dispatch.request(0) == [Sent(2, 0, "a", "ours", is_whole=False)]


def test_shard_that_may_drift_waits_for_a_worker_and_not_for_a_time() -> None:
    dispatch = Fleet(allows_drift=True)
    dispatch.handle(ShardSeen(0, "theirs"))
    dispatch.request(0)
    dispatch.handle(Ticked(100.0))
    assert dispatch.handle(Ticked(100.0 + DRIFT_S)) == []
    assert dispatch.wake_s is None
    assert dispatch.handle(joined("a", "ours")) == [
        Sent(1, 0, "a", "ours", is_whole=True)
    ]


def test_shard_does_not_drift_if_its_platform_returns_in_time() -> None:
    dispatch = drifting()
    assert dispatch.handle(joined("z", "theirs")) == [
        Sent(1, 0, "z", "theirs", is_whole=True)
    ]
    dispatch.handle(Left("z"))
    # The waiting time starts again.
    dispatch.handle(Ticked(110.0))
    assert dispatch.handle(Ticked(100.0 + DRIFT_S)) == []
    assert len(dispatch.handle(Ticked(110.0 + DRIFT_S))) == 1


@pytest.mark.parametrize("allows_drift", [True, False])
def test_shard_does_not_drift_unless_allowed(*, allows_drift: bool) -> None:
    dispatch = drifting(allows_drift=allows_drift, may_drift=not allows_drift)
    assert dispatch.wake_s is None
    assert dispatch.handle(Ticked(1e9)) == []


def test_advances_are_counted_while_they_wait_and_while_a_worker_has_them() -> None:
    dispatch = fleet()
    shards = dispatch.homes
    for shard in (0, 1):
        assert dispatch.request(shard) == []
    assert dispatch.handle(joined("x", kind="analyzer")) == []
    assert dispatch.waiting == {0: "", 1: ""}
    assert (shards.unassigned, shards.assigned) == (2, 0)
    dispatch.handle(joined("a"))
    assert dispatch.waiting == {}
    assert (shards.unassigned, shards.assigned) == (0, 2)
    dispatch.returned(1)
    assert (shards.unassigned, shards.assigned) == (0, 1)
    dispatch.handle(Left("a"))
    assert (shards.unassigned, shards.assigned) == (1, 0)


def advance(dispatch: Fleet, shard: int, start_s: float, lasts_s: float) -> None:
    """Make one advance of a shard."""
    dispatch.handle(Ticked(start_s))
    hand = dispatch.assign(shard)
    dispatch.handle(Ticked(start_s + lasts_s))
    (done, *_) = dispatch.returned(hand.number)
    assert isinstance(done, Ended)


def test_slow_advance_on_several_silent_workers_ends() -> None:
    """The deadline doubles, so that one of them finishes the advance."""
    dispatch = fleet("a", "b")
    dispatch.request(0)
    now_s, lasts_s, assigned_s, moves = 0.0, 1000.0, 0.0, 0
    hand = Sent(1, 0, "a", "p", is_whole=True)
    stale: list[Sent] = []
    while now_s - assigned_s < lasts_s:
        assert now_s < 10 * lasts_s
        now_s += 1.0
        for command in dispatch.handle(Ticked(now_s)):
            if isinstance(command, Sent):
                stale.append(hand)
                hand, assigned_s, moves = command, now_s, moves + 1
        # An agent finishes what it has begun, in vain.
        for old in [each for each in stale if now_s > assigned_s + lasts_s / 20]:
            stale.remove(old)
            assert dispatch.returned(old.number) == []
    assert moves == 6
    assert dispatch.returned(hand.number) == [Ended(0, hand.agent)]


def test_silent_worker_loses_its_advance_to_a_busy_one_with_room() -> None:
    """One that has arenas of its own is never idle until they end."""
    dispatch = fleet("a", "b")
    for shard in (0, 1):
        dispatch.request(shard)
    dispatch.handle(Ticked(FIRST_S))
    dispatch.handle(Progressed("b"))
    assert dispatch.handle(Ticked(FIRST_S + REPLY_S)) == [
        Overdue("a", FIRST_S + REPLY_S, "b"),
        Cancelled(1, 0, "a"),
        Sent(3, 0, "b", "p", is_whole=True),
    ]
    # One without room gets none.
    dispatch = Fleet()
    for name in "ab":
        dispatch.handle(Joined(name, "worker", 1, "p", shards=1))
    for shard in (0, 1):
        dispatch.request(shard)
    dispatch.handle(Ticked(FIRST_S))
    dispatch.handle(Progressed("b"))
    lines = [Overdue("a", FIRST_S + REPLY_S)]
    assert dispatch.handle(Ticked(FIRST_S + REPLY_S)) == lines


@pytest.mark.parametrize("advance_s", [0.1, 4.0])
def test_deadlines_of_advances_follow_their_simulated_time(advance_s: float) -> None:
    dispatch = fleet("a", "b")
    dispatch.request(0, 40.0)
    # The first: ten times faster than real time.
    assert dispatch.handle(Ticked(3.9)) == []
    assert dispatch.handle(Ticked(4.1)) == [AskProgress("a")]
    dispatch.returned(1)
    dispatch.request(0, 10.0)
    dispatch.handle(Ticked(4.1 + advance_s))
    dispatch.returned(2)
    dispatch.handle(Ticked(100.0))
    dispatch.request(0, 20.0)
    limit_s = max(LEAST_S, PATIENCE * 2.0 * advance_s)
    assert dispatch.handle(Ticked(99.9 + limit_s)) == []
    assert dispatch.handle(Ticked(100.2 + limit_s)) == [AskProgress("a")]


def test_silent_worker_keeps_its_advance_while_no_other_is_idle() -> None:
    dispatch = fleet("a", "b")
    for shard in (0, 1):
        dispatch.handle(ShardSeen(shard, "p"))
        dispatch.request(shard)
    dispatch.handle(joined("c", "another"))
    dispatch.handle(joined("d", kind="analyzer"))
    dispatch.handle(Ticked(FIRST_S))
    assert dispatch.handle(Ticked(FIRST_S + REPLY_S)) == [
        Overdue("a", FIRST_S + REPLY_S),
        Overdue("b", FIRST_S + REPLY_S),
    ]
    told = [
        command
        for minute in range(2, 50)
        for command in dispatch.handle(Ticked(minute * FIRST_S))
    ]
    assert {type(command) for command in told} == {AskProgress}
    assert [dispatch.holder(0), dispatch.holder(1)] == ["a", "b"]


def test_all_advances_of_a_silent_worker_move_at_once() -> None:
    dispatch = fleet("a", "b")
    for shard in range(4):
        dispatch.request(shard)
    for number in (2, 4):
        dispatch.returned(number)
    dispatch.handle(Ticked(FIRST_S))
    dispatch.handle(Ticked(FIRST_S + REPLY_S))
    assert [dispatch.holder(shard) for shard in range(4)] == ["b"] * 4
    # A new shard avoids the silent worker until it gives a sign of life.
    assert dispatch.assign(4).agent == "b"
    dispatch.handle(Progressed("a"))
    assert dispatch.assign(5).agent == "a"


def spread(dispatch: Fleet, shards: int) -> Counter[str]:
    """Return how many shards each worker holds."""
    return Counter(dispatch.holder(shard) for shard in range(shards))


def test_full_worker_gets_a_shard_only_if_all_are_full() -> None:
    dispatch = Fleet()
    dispatch.handle(Joined("a", "worker", 1, "p", shards=2))
    dispatch.handle(Joined("b", "worker", 1, "p", shards=5))
    for shard in range(7):
        dispatch.assign(shard)
    assert spread(dispatch, 7) == {"a": 2, "b": 5}
    (told, hand) = dispatch.request(7)
    assert told == Crowded(8, 7)
    assert isinstance(hand, Sent)
    dispatch.assign(8)


def test_shards_spread_by_cores() -> None:
    dispatch = Fleet()
    dispatch.handle(Joined("a", "worker", 1, "p", shards=16, cores=1))
    dispatch.handle(Joined("b", "worker", 1, "p", shards=16, cores=3))
    for shard in range(12):
        dispatch.request(shard)
    assert spread(dispatch, 12) == {"a": 3, "b": 9}


def test_forty_shards_on_two_workers_are_never_rebuilt() -> None:
    dispatch = Fleet()
    for name in ("a", "b"):
        dispatch.handle(Joined(name, "worker", 1, "p", shards=20))
    hands = [dispatch.assign(shard) for shard in range(40)]
    for _ in range(10):
        following = []
        for hand in hands:
            dispatch.returned(hand.number)
            following.append(dispatch.assign(hand.shard))
        hands = following
    assert spread(dispatch, 40) == {"a": 20, "b": 20}
    assert dispatch.homes.rebuilt == 0
    dispatch.handle(Left("a"))
    assert dispatch.homes.rebuilt == 20


def test_worker_that_joins_late_takes_over_its_share() -> None:
    dispatch = fleet("a")
    (first, *_) = [dispatch.assign(shard) for shard in range(6)]
    dispatch.returned(first.number)
    commands = dispatch.handle(joined("b"))
    # Those that wait in the queue of the other; none of them has a state yet.
    assert [
        command.shard for command in commands if isinstance(command, Cancelled)
    ] == [5, 4, 3]
    assert spread(dispatch, 6) == {"a": 3, "b": 3}
    assert dispatch.homes.rebuilt == 0


def test_shard_with_a_state_moves_after_its_present_advance() -> None:
    dispatch = fleet("a")
    for shard in (0, 1):
        advance(dispatch, shard, shard, 0.5)
    hand = dispatch.assign(1)
    assert dispatch.handle(joined("b")) == []
    assert dispatch.returned(hand.number) == [Ended(1, "a")]
    assert dispatch.assign(1) == Sent(4, 1, "b", "p", is_whole=True)
    assert dispatch.homes.rebuilt == 1
