"""How arenas are held back for those who watch."""

import pytest

from coordinator.run.throttle import RealTimeThrottle


def test_each_advance_waits_for_its_time() -> None:
    throttle = RealTimeThrottle(2.0, 0.005)
    assert throttle.due_s(0, 0, 100.0) == 100.0
    # 5 s of the arena are 2.5 s of ours.
    assert throttle.due_s(0, 1000, 100.1) == pytest.approx(102.5)
    assert throttle.due_s(0, 2000, 102.6) == pytest.approx(105.0)


def test_who_comes_late_does_not_catch_up() -> None:
    throttle = RealTimeThrottle(1.0, 0.005)
    throttle.due_s(0, 0, 0.0)
    assert throttle.due_s(0, 1000, 60.0) == 60.0
    assert throttle.due_s(0, 2000, 60.5) == pytest.approx(65.0)


def test_arenas_have_their_own_time() -> None:
    throttle = RealTimeThrottle(1.0, 0.005)
    throttle.due_s(0, 0, 0.0)
    assert throttle.due_s(1, 4000, 7.0) == 7.0
    assert throttle.due_s(0, 1000, 1.0) == pytest.approx(5.0)
