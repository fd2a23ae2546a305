"""Assignment of shards to workers, event by event."""

from itertools import count

import pytest

from coordinator.dispatch.events import (
    AssignShard,
    Joined,
    Killed,
    Left,
    ShardDone,
    ShardFailed,
    ShardRequested,
    ShardReturned,
    ShardSeen,
    Ticked,
)
from coordinator.dispatch.shards import DRIFT_S, MAX_ERRORS, ShardDispatch
from schema.errors import UnexpectedEvent


def joined(name: str, platform: str = "p", kind: str = "worker") -> Joined:
    return Joined(name, kind, 1, platform)  # type: ignore[arg-type]


def fleet(*names: str) -> ShardDispatch:
    dispatch = ShardDispatch(count(1))
    for name in names:
        assert dispatch.handle(joined(name)) == []
    return dispatch


def test_first_advance_is_whole_and_the_next_goes_on() -> None:
    dispatch = fleet("b", "a")
    assert dispatch.handle(ShardRequested(0)) == [
        AssignShard(1, 0, "a", "p", is_whole=True)
    ]
    assert dispatch.handle(ShardReturned(1, "done")) == [ShardDone(0, "a")]
    assert dispatch.handle(ShardRequested(0)) == [
        AssignShard(2, 0, "a", "p", is_whole=False)
    ]


def test_shard_waits_for_a_worker() -> None:
    dispatch = fleet()
    assert dispatch.handle(ShardRequested(0)) == []
    assert dispatch.waiting == {0: ""}
    assert dispatch.handle(joined("x", kind="analyzer")) == []
    assert dispatch.handle(joined("a")) == [AssignShard(1, 0, "a", "p", is_whole=True)]
    assert dispatch.waiting == {}


def test_shards_spread_over_workers() -> None:
    dispatch = fleet("a", "b")
    agents = [dispatch.handle(ShardRequested(number))[0] for number in range(4)]
    assert [hand.agent for hand in agents if isinstance(hand, AssignShard)] == list(
        "abab"
    )
    assert dispatch.holder(2) == "a"


def test_dead_holder_is_replaced_at_once_with_the_whole_state() -> None:
    dispatch = fleet("a", "b")
    dispatch.handle(ShardRequested(0))
    assert dispatch.handle(Left("a")) == [AssignShard(2, 0, "b", "p", is_whole=True)]
    # Its own end as a job comes late and says nothing new.
    assert dispatch.handle(ShardReturned(1, "lost")) == []
    assert dispatch.handle(ShardReturned(1, "done")) == []
    assert dispatch.handle(ShardReturned(2, "done")) == [ShardDone(0, "b")]


def test_holder_that_dies_between_advances() -> None:
    dispatch = fleet("a", "b")
    dispatch.handle(ShardRequested(0))
    dispatch.handle(ShardReturned(1, "done"))
    assert dispatch.handle(Left("a")) == []
    assert dispatch.handle(ShardRequested(0)) == [
        AssignShard(2, 0, "b", "p", is_whole=True)
    ]


def test_worker_without_the_state_is_given_it() -> None:
    dispatch = fleet("a", "b")
    dispatch.handle(ShardRequested(0))
    dispatch.handle(ShardReturned(1, "done"))
    dispatch.handle(ShardRequested(0))
    assert dispatch.handle(ShardReturned(2, "stateless")) == [
        AssignShard(3, 0, "a", "p", is_whole=True)
    ]
    # Asking again is an error.
    assert dispatch.handle(ShardReturned(3, "stateless")) == []
    assert dispatch.wake_s is not None
    hands = dispatch.handle(Ticked(dispatch.wake_s))
    assert hands == [AssignShard(4, 0, "b", "p", is_whole=True)]


@pytest.mark.parametrize("outcome", ["error", "lost"])
def test_failed_advance_goes_to_another_worker_after_a_backoff(outcome: str) -> None:
    dispatch = fleet("a", "b")
    dispatch.handle(Ticked(10.0))
    dispatch.handle(ShardRequested(0))
    assert dispatch.handle(ShardReturned(1, outcome, "why")) == []  # type: ignore[arg-type]
    assert dispatch.handle(Ticked(10.01)) == []
    assert dispatch.handle(Ticked(10.05)) == [
        AssignShard(2, 0, "b", "p", is_whole=True)
    ]


def test_advance_that_crashed_three_workers_is_given_up() -> None:
    dispatch = fleet("a", "b", "c")
    dispatch.handle(ShardRequested(0))
    for number, name, following in ((1, "a", "b"), (2, "b", "c")):
        hand = AssignShard(number + 1, 0, following, "p", is_whole=True)
        assert dispatch.handle(Left(name)) == [hand]
        assert dispatch.shard_that_lost(number) == 0
        assert dispatch.handle(Killed(number, name, "SIGSEGV")) == []
    assert dispatch.handle(Left("c")) == []
    reason = f"ended its own process {MAX_ERRORS} times, by SIGSEGV"
    ended = dispatch.handle(Killed(3, "c", "SIGSEGV"))
    assert ended == [ShardFailed(0, "c", reason)]
    assert dispatch.handle(joined("d")) == []


def test_crashes_of_a_finished_advance_are_forgotten() -> None:
    dispatch = fleet("a", "b")
    dispatch.handle(ShardRequested(0))
    dispatch.handle(Left("a"))
    assert dispatch.handle(ShardReturned(2, "done")) == [ShardDone(0, "b")]
    assert dispatch.shard_that_lost(1) is None
    assert dispatch.handle(Killed(1, "a", "SIGSEGV")) == []


def test_errors_of_several_workers_end_an_advance_and_losses_do_not() -> None:
    dispatch = fleet("a", "b")
    dispatch.handle(ShardRequested(0))
    now_s, number = 0.0, 1
    for _ in range(10):
        assert dispatch.handle(ShardReturned(number, "lost")) == []
        now_s += 10.0
        assert len(dispatch.handle(Ticked(now_s))) == 1
        number += 1
    for _ in range(MAX_ERRORS - 1):
        assert dispatch.handle(ShardReturned(number, "error", "no")) == []
        now_s += 10.0
        (hand,) = dispatch.handle(Ticked(now_s))
        number += 1
    assert isinstance(hand, AssignShard)
    given_up = dispatch.handle(ShardReturned(number, "error", "no"))
    assert given_up == [ShardFailed(0, hand.agent, "no")]


def test_only_a_worker_of_an_equal_platform_continues_a_shard() -> None:
    dispatch = ShardDispatch(count(1))
    dispatch.handle(joined("a", "arm"))
    dispatch.handle(joined("b", "x86"))
    dispatch.handle(ShardSeen(0, "x86"))
    assert dispatch.handle(ShardRequested(0)) == [
        AssignShard(1, 0, "b", "x86", is_whole=True)
    ]
    assert dispatch.handle(Left("b")) == []
    assert dispatch.waiting == {0: "x86"}
    assert dispatch.handle(joined("c", "x86")) == [
        AssignShard(2, 0, "c", "x86", is_whole=True)
    ]


def test_first_advance_decides_the_platform() -> None:
    dispatch = ShardDispatch(count(1))
    dispatch.handle(joined("a", "arm"))
    dispatch.handle(ShardRequested(0))
    dispatch.handle(ShardReturned(1, "done"))
    dispatch.handle(Left("a"))
    dispatch.handle(joined("b", "x86"))
    assert dispatch.handle(ShardRequested(0)) == []
    assert dispatch.waiting == {0: "arm"}


def test_second_request_for_a_shard_raises() -> None:
    dispatch = fleet("a")
    dispatch.handle(ShardRequested(0))
    with pytest.raises(UnexpectedEvent, match="requested already"):
        dispatch.handle(ShardRequested(0))


def drifting(*, allows_drift: bool) -> ShardDispatch:
    """Return a shard dispatcher whose shard ran on a platform that has left."""
    dispatch = ShardDispatch(count(1), allows_drift=allows_drift)
    dispatch.handle(ShardSeen(0, "theirs"))
    dispatch.handle(joined("b", "ours"))
    dispatch.handle(joined("a", "ours"))
    assert dispatch.handle(ShardRequested(0)) == []
    assert dispatch.handle(Ticked(100.0)) == []
    assert dispatch.waiting == {0: "theirs"}
    return dispatch


def test_shard_drifts_to_another_platform_after_a_while_if_allowed() -> None:
    dispatch = drifting(allows_drift=True)
    assert dispatch.wake_s == 100.0 + DRIFT_S
    assert dispatch.handle(Ticked(99.9 + DRIFT_S)) == []
    whole = AssignShard(1, 0, "a", "ours", is_whole=True)
    assert dispatch.handle(Ticked(100.0 + DRIFT_S)) == [whole]
    dispatch.handle(ShardReturned(1, "done"))
    # It is at home there now.
    dispatch.handle(joined("c", "theirs"))
    assert dispatch.handle(ShardRequested(0)) == [
        AssignShard(2, 0, "a", "ours", is_whole=False)
    ]


def test_shard_that_may_drift_waits_for_a_worker_and_not_for_a_time() -> None:
    dispatch = ShardDispatch(count(1), allows_drift=True)
    dispatch.handle(ShardSeen(0, "theirs"))
    dispatch.handle(ShardRequested(0))
    dispatch.handle(Ticked(100.0))
    assert dispatch.handle(Ticked(100.0 + DRIFT_S)) == []
    assert dispatch.wake_s is None
    assert dispatch.handle(joined("a", "ours")) == [
        AssignShard(1, 0, "a", "ours", is_whole=True)
    ]


def test_shard_does_not_drift_if_its_platform_returns_in_time() -> None:
    dispatch = drifting(allows_drift=True)
    assert dispatch.handle(joined("z", "theirs")) == [
        AssignShard(1, 0, "z", "theirs", is_whole=True)
    ]
    dispatch.handle(Left("z"))
    # The waiting time starts again.
    dispatch.handle(Ticked(110.0))
    assert dispatch.handle(Ticked(100.0 + DRIFT_S)) == []
    assert len(dispatch.handle(Ticked(110.0 + DRIFT_S))) == 1


def test_shard_does_not_drift_unless_allowed() -> None:
    dispatch = drifting(allows_drift=False)
    assert dispatch.wake_s is None
    assert dispatch.handle(Ticked(1e9)) == []


def test_advances_are_counted_while_they_wait_and_while_a_worker_has_them() -> None:
    dispatch = fleet()
    dispatch.handle(ShardRequested(0))
    dispatch.handle(ShardRequested(1))
    assert (dispatch.unassigned, dispatch.assigned) == (2, 0)
    dispatch.handle(joined("a"))
    assert (dispatch.unassigned, dispatch.assigned) == (0, 2)
    dispatch.handle(ShardReturned(1, "done"))
    assert (dispatch.unassigned, dispatch.assigned) == (0, 1)
    dispatch.handle(Left("a"))
    assert (dispatch.unassigned, dispatch.assigned) == (1, 0)
