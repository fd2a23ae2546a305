"""How arenas are held back for those who watch."""

import pytest

from coordinator.run.pacing import Pace


def test_each_advance_waits_for_its_time() -> None:
    pace = Pace(2.0, 0.005)
    assert pace.due_s(0, 0, 100.0) == 100.0
    # 5 s of the arena are 2.5 s of ours.
    assert pace.due_s(0, 1000, 100.1) == pytest.approx(102.5)
    assert pace.due_s(0, 2000, 102.6) == pytest.approx(105.0)


def test_who_comes_late_does_not_catch_up() -> None:
    pace = Pace(1.0, 0.005)
    pace.due_s(0, 0, 0.0)
    assert pace.due_s(0, 1000, 60.0) == 60.0
    assert pace.due_s(0, 2000, 60.5) == pytest.approx(65.0)


def test_arenas_have_their_own_time() -> None:
    pace = Pace(1.0, 0.005)
    pace.due_s(0, 0, 0.0)
    assert pace.due_s(1, 4000, 7.0) == 7.0
    assert pace.due_s(0, 1000, 1.0) == pytest.approx(5.0)
