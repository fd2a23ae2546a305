"""Detection of jobs that crash their process, or wait without using CPU time.

A process notes each job in memory that it shares with its parent, and limits the CPU
time of the job, and the time that the job waits without using any. If the process then
ends by a signal that only its own code can cause, the job is to blame. SIGKILL, SIGTERM
and a machine that goes down say nothing about the job.
"""

import os
import signal
import struct
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from ctypes import Array, c_char
from multiprocessing import get_context, heap

import msgspec

from schema.wire.codec import decode, encode
from schema.wire.messages import Crash, RunningJob

CPU_LIMIT_S = 3600.0
"""CPU time limit of one job [s]: far above that of any job that ends."""
WAIT_LIMIT_S = 600.0
"""Time that a job may wait without using CPU time [s]: far above any delay of a disk or
an overloaded machine."""
LAST_DEATHS = 8
"""Number of deaths that are remembered for each slot of a pool."""
LOOK_S = 1.0
"""Interval between measurements of the CPU time of a job [s]."""
_LEAST_SHARE = 0.002
"""Share of one core below which a job waits: a loop that only polls needs less."""
_LONGEST_TIMER_S = 1e9
"""Thirty years: a timer takes no time that its system cannot represent."""

_SIZE = 8192
_LENGTH = struct.Struct("<H")
_OUT_OF_TIME = signal.SIGPROF
_WAITED = signal.SIGVTALRM
# Signals that a process causes itself.
_OWN_DOING = (
    signal.SIGABRT,
    signal.SIGBUS,
    signal.SIGFPE,
    signal.SIGILL,
    signal.SIGSEGV,
    signal.SIGSYS,
    _OUT_OF_TIME,
    _WAITED,
)


class CurrentJob:
    """The current job of a process, in memory that it shares with its parent."""

    def __init__(self) -> None:
        if not os.access("/dev/shm", os.W_OK):  # noqa: S108 - as multiprocessing
            # Use a temporary file; this is how its own tests choose the folder.
            heap.Arena._dir_candidates = []  # type: ignore[attr-defined] # noqa: SLF001
        self._memory: Array[c_char] = get_context("spawn").RawArray(c_char, _SIZE)

    @property
    def _view(self) -> memoryview:
        return memoryview(self._memory).cast("B")

    def begin(self, task: RunningJob) -> None:
        """Note a job before it starts; names longer than those of ours are cut."""
        cut = msgspec.structs.replace(task, agent=task.agent[:255], run=task.run[:1000])
        data = encode(cut)
        # The length comes last: half a note does not count.
        self._view[_LENGTH.size :][: len(data)] = data
        _LENGTH.pack_into(self._view, 0, len(data))

    def end(self) -> None:
        """Note that the job is done."""
        _LENGTH.pack_into(self._view, 0, 0)

    def read(self) -> RunningJob | None:
        """Return the job that was started and has not ended, if there is one."""
        (length,) = _LENGTH.unpack_from(self._view)
        data = self._view[_LENGTH.size :][:length]
        return decode(RunningJob, bytes(data), length) if length else None


def crash_cause(exit_code: int) -> str:
    """Return the crash cause if the job itself ended its process, else "".

    The code is minus the number of a signal, or the exit status of the process.
    """
    if exit_code >= 0:
        return f"exit with status {exit_code}"
    number = -exit_code
    if number == _OUT_OF_TIME:
        return "use of too much CPU time"
    if number == _WAITED:
        return "waiting too long without use of CPU time"
    return signal.Signals(number).name if number in _OWN_DOING else ""


class ProcessSlot(msgspec.Struct, frozen=True):
    """A process's slot in a pool.

    Attributes:
        note: of its current job; None without a supervisor.
        deaths: of earlier processes in this slot, oldest first.
    """

    index: int = 0
    note: CurrentJob | None = None
    deaths: tuple[Crash, ...] = ()

    def end_process(self, *, is_blamed: bool) -> None:
        """End this process, whose job waits without end; its supervisor restarts it."""
        if self.note is None:
            return
        if not is_blamed:
            self.note.end()
        os.kill(os.getpid(), _WAITED if is_blamed else signal.SIGKILL)

    @contextmanager
    def doing(self, task: RunningJob, cpu_limit_s: float) -> Iterator[None]:
        """Note a job while it is done; end this process after some CPU time [s]."""
        if self.note is None:
            yield
            return
        self.note.begin(task)
        signal.setitimer(signal.ITIMER_PROF, min(cpu_limit_s, _LONGEST_TIMER_S))
        try:
            yield
        except Exception:
            self.note.end()
            raise
        finally:
            signal.setitimer(signal.ITIMER_PROF, 0.0)
        # Not if the job ends the process: SystemExit is no Exception.
        self.note.end()


class JobWatch:
    """Time since the current job last used CPU.

    One thread begins and ends jobs, whose CPU time has a clock; another one measures.
    """

    def __init__(
        self, cpu_s: Callable[[], float], now_s: Callable[[], float] = time.monotonic
    ) -> None:
        self.task: RunningJob | None = None
        self._cpu_s, self._now_s = cpu_s, now_s
        self._measured = (now_s(), cpu_s())
        self._active_s = 0.0

    def begin(self, task: RunningJob) -> None:
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


def thread_clock(thread: int) -> Callable[[], float]:
    """Return a clock of the CPU time of a thread [s].

    Where the system has none, the clock is that of the whole process.
    """
    if (clock_id := getattr(time, "pthread_getcpuclockid", None)) is None:
        return time.process_time
    number = clock_id(thread)
    return lambda: time.clock_gettime(number)
