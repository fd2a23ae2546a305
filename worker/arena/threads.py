"""Thread pool for independent jobs; the caller's thread works, too.

The jobs must be independent of each other. Their results then depend neither on the
number of threads nor on the assignment of jobs to threads.
"""

import itertools
import threading
from collections.abc import Callable, Sequence

Job = Callable[[], None]


class Pool:
    """Threads that wait for jobs.

    Attributes:
        threads: number of threads, including the caller's.
    """

    def __init__(self, threads: int = 1) -> None:
        """Start the other threads.

        Args:
            threads: number of threads, including the caller's; >= 1.

        Raises:
            ValueError: fewer than one thread.
        """
        if threads < 1:
            raise ValueError(f"threads must be >= 1, got {threads}")
        self.threads = threads
        self._jobs: Sequence[Job] = ()
        self._next = itertools.count()
        self._ready = threading.Semaphore(0)
        self._done = threading.Semaphore(0)
        self._errors: list[BaseException] = []
        self._is_open = True
        for number in range(threads - 1):
            name = f"arena-{number + 1}"
            threading.Thread(target=self._serve, name=name, daemon=True).start()

    def run(self, jobs: Sequence[Job]) -> None:
        """Run all jobs and return when they have finished.

        Args:
            jobs: most expensive first, for an even load.

        Raises:
            BaseException: the first error that a job raised; all other jobs have run.
        """
        others = min(self.threads, len(jobs)) - 1
        self._jobs, self._next = jobs, itertools.count()
        if others > 0:
            self._ready.release(others)
        self._work()
        for _ in range(others):
            self._done.acquire()
        if self._errors:
            error = self._errors[0]
            self._errors.clear()
            raise error

    def close(self) -> None:
        """Stop the threads; the pool cannot run any more jobs."""
        if self._is_open and self.threads > 1:
            self._is_open = False
            self._ready.release(self.threads - 1)

    def _serve(self) -> None:
        while True:
            self._ready.acquire()
            if not self._is_open:
                return
            self._work()
            self._done.release()

    def _work(self) -> None:
        jobs, numbers = self._jobs, self._next
        # The counter's step is atomic, so each number goes to one thread.
        for number in numbers:
            if number >= len(jobs):
                return
            try:
                jobs[number]()
            except BaseException as error:  # noqa: BLE001 - re-raised by the caller
                self._errors.append(error)
