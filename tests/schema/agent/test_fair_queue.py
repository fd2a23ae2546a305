"""Sources share an agent's time; a crowded queue drops what came last."""

import pytest

from schema.agent.fair_queue import MOST_SOURCES, FairQueue
from schema.limits import WAITING_JOB_BYTES


def test_one_source_is_served_in_the_order_of_arrival() -> None:
    turns: FairQueue[int] = FairQueue()
    for item in range(5):
        turns.put(b"a", item)
    assert len(turns) == 5
    assert [turns.take() for _ in range(5)] == [0, 1, 2, 3, 4]
    with pytest.raises(IndexError):
        turns.take()


def _shares(jobs_s: dict[bytes, float], until_s: float) -> dict[bytes, float]:
    """Return the time of each source if all sources always have two jobs waiting."""
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


def test_absent_source_saves_up_no_time() -> None:
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


def test_number_of_idle_accounts_is_limited() -> None:
    turns: FairQueue[int] = FairQueue()
    for number in range(3 * MOST_SOURCES):
        turns.put(str(number).encode(), number)
        assert turns.take() == number
    assert len(turns._accounts) <= MOST_SOURCES + 1


def test_a_crowded_queue_drops_the_newest_of_the_greediest_source() -> None:
    turns: FairQueue[str] = FairQueue(most_bytes=4 * WAITING_JOB_BYTES)
    assert turns.put(b"run", "job", 100) == []
    dropped = [turns.put(b"", f"junk {number}") for number in range(5)]
    assert dropped == [[], [], ["junk 2"], ["junk 3"], ["junk 4"]]
    assert len(turns) == 3
    assert sorted(turns.take() for _ in range(3)) == ["job", "junk 0", "junk 1"]
    assert not turns


def test_a_queue_takes_one_item_of_any_size() -> None:
    turns: FairQueue[str] = FairQueue(most_bytes=10)
    assert turns.put(b"run", "large", 1000) == []
    assert turns.put(b"other", "x", 1) == ["large"]
    assert turns.take() == "x"
