"""What a process is at, so that whoever started it can say what it died of.

A process notes each job in memory that it shares with its parent, and gives itself
so much CPU time for it and no more. If it then ends by a signal that only its own
code brings about, the job did that; SIGKILL, SIGTERM and a machine that goes down
are nobody's doing, and say nothing of the job.
"""

import signal
import struct
from collections.abc import Iterator
from contextlib import contextmanager
from ctypes import Array, c_char
from dataclasses import dataclass
from multiprocessing import get_context

CPU_LIMIT_S = 3600.0
"""CPU time of one job [s]: far more than any takes that ends."""
LAST_DEATHS = 8
"""Of one place in a crew, those that are remembered."""

_SIZE = 2048
_HEAD = struct.Struct("<HHQQ")
_OUT_OF_TIME = signal.SIGPROF
# What a process brings upon itself.
_OWN_DOING = (
    signal.SIGABRT,
    signal.SIGBUS,
    signal.SIGFPE,
    signal.SIGILL,
    signal.SIGSEGV,
    signal.SIGSYS,
    _OUT_OF_TIME,
)


@dataclass(frozen=True, slots=True)
class Task:
    """A process and the job that it is at.

    Attributes:
        agent: the process's name.
        run, epoch, number: of the job.
    """

    agent: str
    run: str
    epoch: int
    number: int


@dataclass(frozen=True, slots=True)
class Death:
    """A process that died of its job, by the job's own doing, such as "SIGSEGV"."""

    task: Task
    cause: str


class CurrentJob:
    """What a process is at; its parent reads it when the process has died."""

    def __init__(self) -> None:
        """Be at nothing; made by the parent."""
        self._memory: Array[c_char] = get_context("spawn").RawArray(c_char, _SIZE)

    @property
    def _view(self) -> memoryview:
        return memoryview(self._memory).cast("B")

    def begin(self, task: Task) -> None:
        """Note a job before it is begun."""
        name = task.agent.encode()[:255]
        run = task.run.encode()[: _SIZE - _HEAD.size - len(name)]
        end = _HEAD.size + len(name) + len(run)
        # The lengths come last: half a note is none.
        view = self._view
        view[_HEAD.size : end] = name + run
        _HEAD.pack_into(view, 0, len(name), len(run), task.epoch, task.number)

    def end(self) -> None:
        """Note that the job is done."""
        self._view[:2] = b"\0\0"

    def read(self) -> Task | None:
        """Return the job that was begun and not done, if there is one."""
        view = self._view
        name, run, epoch, number = _HEAD.unpack_from(view)
        if not name:
            return None
        text = bytes(view[_HEAD.size : _HEAD.size + name + run])
        return Task(
            text[:name].decode(errors="replace"),
            text[name:].decode(errors="replace"),
            epoch,
            number,
        )


def crash_cause(exit_code: int) -> str:
    """Return what a process did that ended in the middle of a job; empty if nothing.

    Args:
        exit_code: as ``multiprocessing`` has it: minus a signal's number, or what
            the process ended itself with.
    """
    if exit_code >= 0:
        return f"exit with status {exit_code}"
    number = -exit_code
    if number == _OUT_OF_TIME:
        return "use of too much CPU time"
    return signal.Signals(number).name if number in _OWN_DOING else ""


@dataclass(frozen=True, slots=True)
class ProcessSlot:
    """A process's place in a crew.

    Attributes:
        index: of the place.
        note: where its job stands; None if nobody looks after it.
        deaths: of those who had this place before, oldest first.
    """

    index: int = 0
    note: CurrentJob | None = None
    deaths: tuple[Death, ...] = ()

    @contextmanager
    def doing(self, task: Task, cpu_limit_s: float) -> Iterator[None]:
        """Note a job while it is done.

        Args:
            task: the job, for the process that supervises this one.
            cpu_limit_s: CPU time after which this process is ended [s].
        """
        if self.note is None:
            yield
            return
        self.note.begin(task)
        signal.setitimer(signal.ITIMER_PROF, cpu_limit_s)
        try:
            yield
        except Exception:
            self.note.end()
            raise
        finally:
            signal.setitimer(signal.ITIMER_PROF, 0.0)
        # Not if the job ends the process: SystemExit is no Exception.
        self.note.end()
