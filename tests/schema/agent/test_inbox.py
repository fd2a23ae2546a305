"""Queues: items of threads, and a fair one of sources."""

import subprocess
import sys
import threading
import time
from queue import Empty

import pytest

from schema.agent.inbox import MOST_SOURCES, TURN_S, FairQueue, Inbox
from schema.limits import WAITING_JOB_BYTES


def test_items_of_each_thread_are_in_order() -> None:
    inbox: Inbox[tuple[int, int]] = Inbox()
    count, threads = 20_000, 4

    def put(thread: int) -> None:
        for number in range(count):
            inbox.put((thread, number))

    putting = [threading.Thread(target=put, args=(one,)) for one in range(threads)]
    for each in putting:
        each.start()
    got: list[tuple[int, int]] = []
    until_s = time.monotonic() + 60.0
    while len(got) < count * threads and time.monotonic() < until_s:
        try:
            got.append(inbox.get(5.0))
        except Empty:
            continue
    for each in putting:
        each.join()
    for thread in range(threads):
        numbers = [number for one, number in got if one == thread]
        assert numbers == list(range(count))
    with pytest.raises(Empty):
        inbox.get_nowait()


def test_an_item_ends_a_wait() -> None:
    inbox: Inbox[str] = Inbox()
    # Of an earlier item, that had ended no wait.
    inbox.put("first")
    assert inbox.get(9.0) == "first"
    began_s = time.monotonic()
    timer = threading.Timer(0.2, inbox.put, ("second",))
    timer.start()
    assert inbox.get(60.0) == "second"
    assert 0.1 < time.monotonic() - began_s < 30.0


@pytest.mark.parametrize("timeout_s", [0.0, -1.0, 0.05])
def test_a_wait_has_an_end(timeout_s: float) -> None:
    inbox: Inbox[str] = Inbox()
    began_s = time.monotonic()
    with pytest.raises(Empty):
        inbox.get(timeout_s)
    assert time.monotonic() - began_s >= timeout_s


# Signals arrive around the ends of 1000 waits. Those of ``SimpleQueue`` do not end
# before Python 3.13: it takes a few dozen.
SIGNALLED = """
import random, signal
from queue import Empty
from schema.agent.inbox import Inbox

inbox = Inbox()
signal.signal(signal.SIGALRM, lambda *_: None)
for _ in range(1000):
    delay_s = 0.002 + random.uniform(-0.0002, 0.0003)
    signal.setitimer(signal.ITIMER_REAL, delay_s)
    try:
        inbox.get(0.002)
    except Empty:
        pass
signal.setitimer(signal.ITIMER_REAL, 0.0)

# A handler may put.
signal.signal(signal.SIGALRM, lambda *_: inbox.put("rung"))
signal.setitimer(signal.ITIMER_REAL, 0.1)
print(inbox.get(60.0))
"""


@pytest.mark.skipif(sys.platform == "win32", reason="setitimer")
def test_a_signal_at_the_end_of_a_wait_does_not_make_it_endless() -> None:
    done = subprocess.run(
        [sys.executable, "-c", SIGNALLED],
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
    )
    assert (done.stdout, done.stderr) == ("rung\n", "")


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


def test_quick_jobs_of_a_source_are_done_one_after_the_other() -> None:
    turns: FairQueue[bytes] = FairQueue()
    for _ in range(4):
        turns.put(b"a", b"a")
        turns.put(b"b", b"b")
    order = b""
    while turns:
        order += turns.take()
        turns.spent(0.5 * TURN_S)
    assert order == b"aabbbbaa"


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
