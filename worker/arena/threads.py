"""Thread pool for independent jobs; the caller's thread works, too.

The jobs must be independent of each other. Their results then depend neither on the
number of threads nor on the assignment of jobs to threads.
"""

from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor, wait

Job = Callable[[], None]


class ThreadTeam:
    """Threads, the caller's included, that share jobs: one submission each is cheap."""

    def __init__(self, threads: int = 1) -> None:
        self.threads = threads
        self._others = ThreadPoolExecutor(max(1, threads - 1), "arena")

    def run(self, jobs: Sequence[Job]) -> None:
        """Run all jobs, the most expensive first; return when they have finished.

        Raises:
            BaseException: an error that a job raised; no job runs any more.
        """
        left = iter(jobs)

        def work() -> None:
            # The iterator's step is atomic, so each job goes to one thread.
            for job in left:
                job()

        others = min(self.threads, len(jobs)) - 1
        working = [self._others.submit(work) for _ in range(others)]
        try:
            work()
        finally:
            wait(working)
        for each in working:
            each.result()

    def close(self) -> None:
        """Stop the threads; the pool cannot run any more jobs."""
        self._others.shutdown()
