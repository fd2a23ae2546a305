"""Queue from the threads of the network to the one that handles its messages."""

import threading
from contextlib import suppress
from queue import Empty, SimpleQueue
from typing import Generic, TypeVar

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
        """Return the next item.

        Raises:
            Empty: there is none.
        """
        return self._items.get_nowait()

    def get(self, timeout_s: float) -> T:
        """Return the next item, once there is one; the wait is rarely shorter.

        Raises:
            Empty: none came in time.
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
