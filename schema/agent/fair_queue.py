"""Who is served next by an agent that several coordinators give jobs to.

Each source has an account of the time that it was served. The one with the least of
those that wait is next, in the order of arrival among its own; so every source gets
the same share of an agent's time, however long its jobs are. Who was away comes back
at the level of the others: time that nobody asked for is not saved up.
Source: start-time fair queueing (Goyal, Vin and Cheng 1996), with served time for
packet lengths.
"""

from collections import deque
from typing import Generic, TypeVar

T = TypeVar("T")

MOST_SOURCES = 1000
"""Accounts that are kept of those who have nothing waiting."""


class FairQueue(Generic[T]):
    """What waits, by who sent it."""

    def __init__(self) -> None:
        """Have nothing waiting."""
        self._waiting: dict[bytes, deque[T]] = {}
        self._accounts: dict[bytes, float] = {}
        self._served = b""
        self._level_s = 0.0

    def __len__(self) -> int:
        """Return how many items wait."""
        return sum(map(len, self._waiting.values()))

    def put(self, source: bytes, item: T) -> None:
        """Let an item wait."""
        if source not in self._waiting:
            account_s = max(self._accounts.pop(source, 0.0), self._level_s)
            self._accounts[source] = account_s
            self._waiting[source] = deque()
        self._waiting[source].append(item)

    def take(self) -> T:
        """Return the item whose turn it is.

        Raises:
            IndexError: nothing waits.
        """
        if not self._waiting:
            raise IndexError("nothing waits")
        source = min(self._waiting, key=self._accounts.__getitem__)
        self._served, self._level_s = source, self._accounts[source]
        queue = self._waiting[source]
        item = queue.popleft()
        if not queue:
            del self._waiting[source]
            self._forget()
        return item

    def spent(self, seconds: float) -> None:
        """Note how long the item that was taken last took."""
        if self._served in self._accounts:
            self._accounts[self._served] += seconds

    def _forget(self) -> None:
        """Drop the oldest accounts of those who have nothing waiting."""
        if len(self._accounts) - len(self._waiting) > MOST_SOURCES:
            for source in [
                each for each in self._accounts if each not in self._waiting
            ]:
                if source != self._served:
                    del self._accounts[source]
