"""Queues of requests: from the threads of the network, and fair to each source."""

import threading
from collections import deque
from contextlib import suppress
from queue import Empty, SimpleQueue
from typing import Generic, TypeVar

from schema.limits import MOST_WAITING_BYTES, WAITING_JOB_BYTES

T = TypeVar("T")


class Inbox(Generic[T]):
    """Items in order of arrival; any thread may put, one thread gets.

    ``SimpleQueue.get`` with a timeout waits for ever before Python 3.13 if a signal
    arrives within microseconds of the timeout: what is left of it becomes negative.
    ``Queue`` has a lock that is not reentrant, but garbage collection during ``put``
    may drop an object of the network, which puts again.
    """

    def __init__(self) -> None:
        self._items: SimpleQueue[T] = SimpleQueue()
        # Held while the getting thread waits; ``put`` releases it.
        self._bell = threading.Lock()

    def put(self, item: T) -> None:
        """Add an item; from any thread, also from signal handlers."""
        self._items.put(item)
        if self._bell.locked():
            with suppress(RuntimeError):  # another thread has released it
                self._bell.release()

    def get_nowait(self) -> T:
        """Return the next item; raise ``Empty`` if there is none."""
        return self._items.get_nowait()

    def get(self, timeout_s: float) -> T:
        """Return the next item, once there is one; the wait is rarely shorter.

        If none comes in time, ``Empty`` is raised.
        """
        with suppress(Empty):
            return self._items.get_nowait()
        self._bell.acquire(blocking=False)
        # What came before that has not released the lock.
        with suppress(Empty):
            return self._items.get_nowait()
        # A thread that put an earlier item may release the lock only now.
        self._bell.acquire(timeout=max(0.0, timeout_s))
        return self._items.get_nowait()


TURN_S = 0.005
"""Time by which a source may be ahead of others; replies wait as long [s]."""
MOST_SOURCES = 1000
"""Most accounts that are kept of sources without waiting items."""


class FairQueue(Generic[T]):
    """Waiting items of several sources, each of which gets the same share of time.

    Each source has an account of the time that it was served. The waiting source with
    the least time is next, once the last one has ``TURN_S`` more; its own items come in
    order of arrival. A source that comes back continues at the level of the others: it
    cannot save up unused time.
    Beyond a limit the newest items of the source with the most bytes are dropped.
    Source: start-time fair queueing (Goyal, Vin and Cheng 1996), with served time for
    packet lengths.
    """

    def __init__(self, most_bytes: int = MOST_WAITING_BYTES) -> None:
        self._most_bytes = most_bytes
        # Of all that waits, and by source; each item counts its overhead.
        self._bytes = 0
        self._bytes_of: dict[bytes, int] = {}
        self._waiting: dict[bytes, deque[tuple[T, int]]] = {}
        self._accounts: dict[bytes, float] = {}
        self._served = b""
        self._level_s = 0.0

    def __len__(self) -> int:
        return sum(map(len, self._waiting.values()))

    def put(self, source: bytes, item: T, size: int = 0) -> list[T]:
        """Add an item of a size [bytes]; return those that are dropped."""
        if source not in self._waiting:
            account_s = max(self._accounts.pop(source, 0.0), self._level_s)
            self._accounts[source] = account_s
            self._waiting[source] = deque()
        cost = size + WAITING_JOB_BYTES
        self._waiting[source].append((item, cost))
        self._count(source, cost)
        dropped: list[T] = []
        # One item may be larger than the limit.
        while self._bytes > self._most_bytes and (
            len(self._waiting) > 1 or len(self._waiting[source]) > 1
        ):
            crowd = max(self._bytes_of, key=self._bytes_of.__getitem__)
            last, cost = self._waiting[crowd].pop()
            self._count(crowd, -cost)
            dropped.append(last)
        return dropped

    def _count(self, source: bytes, cost: int) -> None:
        """Add the bytes of an item; forget a source without items."""
        self._bytes += cost
        self._bytes_of[source] = self._bytes_of.get(source, 0) + cost
        if not self._waiting[source]:
            del self._waiting[source], self._bytes_of[source]

    def take(self) -> T:
        """Remove and return the next item; ``IndexError`` if the queue is empty."""
        if not self._waiting:
            raise IndexError("the queue is empty")
        source = min(self._waiting, key=self._accounts.__getitem__)
        self._level_s = self._accounts[source]
        # Replies to one source travel together.
        if self._served in self._waiting:
            ahead_s = self._accounts[self._served] - self._level_s
            source = self._served if ahead_s < TURN_S else source
        self._served = source
        queue = self._waiting[source]
        item, cost = queue.popleft()
        self._count(source, -cost)
        if not queue:
            self._forget()
        return item

    def spent(self, seconds: float) -> None:
        """Note the time that the last item took [s]."""
        if self._served in self._accounts:
            self._accounts[self._served] += seconds

    def _forget(self) -> None:
        """Drop the accounts of sources without waiting items if there are too many."""
        if len(self._accounts) - len(self._waiting) > MOST_SOURCES:
            kept = {*self._waiting, self._served}
            self._accounts = {k: v for k, v in self._accounts.items() if k in kept}
