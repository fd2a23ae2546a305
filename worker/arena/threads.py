"""Threads that share out independent jobs, the caller's own thread among them.

The jobs must not know of each other; then what they come to does not depend on
how many threads there are, nor on which of them does which job.
"""

import itertools
import threading
from collections.abc import Callable, Sequence

Job = Callable[[], None]


class Pool:
    """A few threads that wait for jobs.

    Attributes:
        threads: how many work, the caller's included.
    """

    def __init__(self, threads: int = 1) -> None:
        """Start the other threads.

        Args:
            threads: how many work, the caller's included; >= 1.

        Raises:
            ValueError: fewer than one.
        """
        if threads < 1:
            raise ValueError(f"threads must be >= 1, got {threads}")
        self.threads = threads
        self._jobs: Sequence[Job] = ()
        self._next = itertools.count()
        self._wanted = threading.Semaphore(0)
        self._done = threading.Semaphore(0)
        self._errors: list[BaseException] = []
        self._is_open = True
        for number in range(threads - 1):
            name = f"arena-{number + 1}"
            threading.Thread(target=self._serve, name=name, daemon=True).start()

    def run(self, jobs: Sequence[Job]) -> None:
        """Do all jobs and return when they are done.

        Args:
            jobs: dearest first, so that none is left alone at the end.

        Raises:
            BaseException: what a job raised, the first that was seen; the other
                jobs have been done all the same.
        """
        others = min(self.threads, len(jobs)) - 1
        self._jobs, self._next = jobs, itertools.count()
        if others > 0:
            self._wanted.release(others)
        self._work()
        for _ in range(others):
            self._done.acquire()
        if self._errors:
            error = self._errors[0]
            self._errors.clear()
            raise error

    def close(self) -> None:
        """Let the threads end; the pool can do nothing more."""
        if self._is_open and self.threads > 1:
            self._is_open = False
            self._wanted.release(self.threads - 1)

    def _serve(self) -> None:
        while True:
            self._wanted.acquire()
            if not self._is_open:
                return
            self._work()
            self._done.release()

    def _work(self) -> None:
        jobs, numbers = self._jobs, self._next
        # One number is handed out once: the counter's step is atomic.
        for number in numbers:
            if number >= len(jobs):
                return
            try:
                jobs[number]()
            except BaseException as error:  # noqa: BLE001 - raised anew by the caller
                self._errors.append(error)
