"""Several coordinators share an agent's time."""

import pytest

from schema.agent.fair_queue import MOST_SOURCES, FairQueue


def test_one_source_is_served_in_the_order_of_arrival() -> None:
    turns: FairQueue[int] = FairQueue()
    for item in range(5):
        turns.put(b"a", item)
    assert len(turns) == 5
    assert [turns.take() for _ in range(5)] == [0, 1, 2, 3, 4]
    with pytest.raises(IndexError):
        turns.take()


def _shares(jobs_s: dict[bytes, float], until_s: float) -> dict[bytes, float]:
    """Return the time that sources get that always have two jobs waiting."""
    turns: FairQueue[bytes] = FairQueue()
    for source in (*jobs_s, *jobs_s):
        turns.put(source, source)
    served = dict.fromkeys(jobs_s, 0.0)
    now_s = 0.0
    while now_s < until_s:
        source = turns.take()
        served[source] += jobs_s[source]
        now_s += jobs_s[source]
        turns.spent(jobs_s[source])
        turns.put(source, source)
    return served


def test_sources_get_equal_time_whatever_their_jobs_take() -> None:
    served = _shares({b"long": 10.0, b"short": 0.04, b"middle": 1.0}, 3000.0)
    assert served == pytest.approx(dict.fromkeys(served, 1000.0), abs=10.1)


def test_jobs_of_equal_length_take_turns() -> None:
    turns: FairQueue[bytes] = FairQueue()
    for item in (b"a1", b"a2", b"a3", b"b1", b"b2", b"c1"):
        turns.put(item[:1], item)
    order = []
    while turns:
        order.append(turns.take())
        turns.spent(1.0)
    assert order == [b"a1", b"b1", b"c1", b"a2", b"b2", b"a3"]


def test_who_was_away_has_saved_nothing_up() -> None:
    turns: FairQueue[bytes] = FairQueue()
    for _ in range(100):
        turns.put(b"a", b"a")
        turns.take()
        turns.spent(1.0)
    for source in (b"a", b"b") * 10:
        turns.put(source, source)
    first = []
    for _ in range(10):
        first.append(turns.take())
        turns.spent(1.0)
    assert 4 <= first.count(b"a") <= 6


def test_who_never_comes_back_is_forgotten() -> None:
    turns: FairQueue[int] = FairQueue()
    for number in range(3 * MOST_SOURCES):
        turns.put(str(number).encode(), number)
        assert turns.take() == number
    assert len(turns._accounts) <= MOST_SOURCES + 1
