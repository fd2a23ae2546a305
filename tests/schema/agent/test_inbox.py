"""Inbox: order, threads, timeouts, and signals at the very end of a wait."""

import subprocess
import sys
import threading
import time
from queue import Empty

import pytest

from schema.agent.inbox import Inbox


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
