"""Delays of arenas, for viewers."""

import pytest

from coordinator.run.throttle import RealTimeThrottle
from schema.wire.arena import AdvanceShard, Changes


def advance(shard: int = 0) -> AdvanceShard:
    return AdvanceShard(shard, 0, 1000, Changes(), wants_snapshot=False)


def test_each_advance_waits_for_its_time() -> None:
    throttle = RealTimeThrottle(2.0)
    assert not throttle.holds_back(advance(), 0.0, 100.0)
    # 5 simulated seconds take 2.5 s.
    assert throttle.holds_back(advance(), 5.0, 100.1)
    assert throttle.wake_s == pytest.approx(102.5)
    assert throttle.due(102.4) == []
    assert throttle.due(102.6) == [advance()]
    assert throttle.due(102.6) == []
    assert throttle.holds_back(advance(), 10.0, 102.6)
    assert throttle.wake_s == pytest.approx(105.0)


def test_late_arena_does_not_catch_up() -> None:
    throttle = RealTimeThrottle(1.0)
    throttle.holds_back(advance(), 0.0, 0.0)
    assert not throttle.holds_back(advance(), 5.0, 60.0)
    assert throttle.holds_back(advance(), 10.0, 60.5)
    assert throttle.wake_s == pytest.approx(65.0)


def test_arenas_are_held_back_independently() -> None:
    throttle = RealTimeThrottle(1.0)
    throttle.holds_back(advance(0), 0.0, 0.0)
    assert not throttle.holds_back(advance(1), 20.0, 7.0)
    assert throttle.holds_back(advance(0), 5.0, 1.0)
    assert throttle.wake_s == pytest.approx(5.0)
    assert throttle.holds_back(advance(1), 23.0, 7.0)
    assert throttle.due(20.0) == [advance(0), advance(1)]
