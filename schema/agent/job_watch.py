"""Measurement of whether the current job of a process uses CPU time."""

import time
from collections.abc import Callable

from schema.agent.supervision import Task

LOOK_S = 1.0
"""Interval between measurements [s]."""
_LEAST_SHARE = 0.002
"""Share of one core below which a job waits: a loop that only polls needs less."""


def thread_clock(thread: int) -> Callable[[], float]:
    """Return a clock of the CPU time of a thread [s].

    Where the system has none, the clock is that of the whole process.

    Args:
        thread: identifier of a running thread of this process.
    """
    if (clock_id := getattr(time, "pthread_getcpuclockid", None)) is None:
        return time.process_time
    number = clock_id(thread)
    return lambda: time.clock_gettime(number)


class JobWatch:
    """Time since the current job last used CPU.

    One thread begins and ends jobs, another one measures.

    Attributes:
        task: the current job; None between jobs.
    """

    def __init__(
        self,
        cpu_s: Callable[[], float],
        now_s: Callable[[], float] = time.monotonic,
    ) -> None:
        """Initialise without a job.

        Args:
            cpu_s: clock of the CPU time of the thread that does the jobs [s].
            now_s: monotonic clock [s].
        """
        self.task: Task | None = None
        self._cpu_s, self._now_s = cpu_s, now_s
        self._measured = (now_s(), cpu_s())
        self._active_s = 0.0

    def begin(self, task: Task) -> None:
        """Note the start of a job."""
        self._active_s = self._now_s()
        self.task = task

    def end(self) -> None:
        """Note the end of a job."""
        self.task = None

    def measure(self) -> None:
        """Compare the CPU time with that of the last measurement."""
        (last_s, last_cpu_s), now_s, cpu_s = (
            self._measured, self._now_s(), self._cpu_s(),
        )  # fmt: skip
        self._measured = now_s, cpu_s
        if cpu_s - last_cpu_s > _LEAST_SHARE * (now_s - last_s):
            self._active_s = now_s

    @property
    def quiet_s(self) -> float | None:
        """Time since the current job used CPU [s]; None between jobs."""
        since_s = self._active_s
        return None if self.task is None else max(0.0, self._now_s() - since_s)
