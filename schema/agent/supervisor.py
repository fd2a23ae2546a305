"""A crew of processes that one process starts, watches and ends.

Processes are spawned, never forked: the network does not survive a fork. One that
ends before its crew does is started again, whatever it ended by; if it ended itself
and not by its job, after a rest that grows as long as it does so soon. None outlives
the one that started it. Who takes a dead one's place is told what that one died of,
if its job did it.
"""

import contextlib
import math
import os
import signal
import sys
import threading
import time
from collections.abc import Callable
from dataclasses import replace
from multiprocessing import connection, get_context, parent_process, resource_tracker
from multiprocessing.context import SpawnProcess
from typing import Any, Self

from schema.agent.supervision import (
    LAST_DEATHS,
    CurrentJob,
    Death,
    ProcessSlot,
    crash_cause,
)

# So that results depend on no library's number of threads. These count only if
# set before numpy is imported: in whoever starts the crew.
_ONE_THREAD = (
    "OPENBLAS_NUM_THREADS",
    "OMP_NUM_THREADS",
    "MKL_NUM_THREADS",
    "VECLIB_MAXIMUM_THREADS",
    "NUMEXPR_NUM_THREADS",
)
# The network of one process is served by one thread: a job then costs two fifths
# less CPU than when it is handed from thread to thread. The user's own word counts.
_NETWORK = (
    "(rx: (worker_threads: 1), net: (handover: rx), acc: (handover: rx), "
    "tx: (handover: rx))"
)
# What glibc takes from the system in one piece, and gives back in one [bytes]. If left
# to itself it raises this to the size of a robot's simulation, and robots that come and
# go leave holes: a worker's memory then creeps up by a tenth over 3000 births.
_ONE_PIECE = "131072"
GRACE_S = 10.0
_BETWEEN_STARTS_S = 1.0
_LONGEST_REST_S = 30.0
# What is pressed again sooner is one wish: a Ctrl-C of an impatient finger.
_ONE_WISH_S = 1.0


def prepare_process() -> None:
    """Have this process and its children share a machine with many of their kind.

    Libraries, and the network, use one thread; nobody who wakes up interrupts who
    computes, for a few milliseconds; children give back the memory that they leave.
    """
    os.environ.update(dict.fromkeys(_ONE_THREAD, "1"))
    os.environ.setdefault("ZENOH_RUNTIME", _NETWORK)
    os.environ.setdefault("MALLOC_MMAP_THRESHOLD_", _ONE_PIECE)
    _interrupt_nobody()


def _interrupt_nobody() -> None:
    """Let this thread, and all that it starts, wait for the scheduler's next tick.

    Only where no core is free: a worker has its next job at hand, and a message that
    waits costs nothing, but each interruption a cold cache. It halves the switches
    from process to process. Who was given another policy keeps it.
    """
    if sys.platform == "linux" and os.sched_getscheduler(0) == os.SCHED_OTHER:
        with contextlib.suppress(OSError):
            os.sched_setscheduler(0, os.SCHED_BATCH, os.sched_param(0))


def cores() -> int:
    """Return how many cores this process may use."""
    affinity = getattr(os, "sched_getaffinity", None)
    return len(affinity(0)) if affinity else os.cpu_count() or 1


class ProcessPool:
    """Processes that all run ``body(*arguments, post)``; use it in a ``with``.

    Attributes:
        restarts: how often one was started anew.
        deaths: of those who died of their job.
    """

    def __init__(
        self, body: Callable[..., None], arguments: tuple[Any, ...], *, size: int
    ) -> None:
        self._body = body
        self._arguments = arguments
        self._context = get_context("spawn")
        self._processes: list[SpawnProcess | None] = [None] * size
        self._started_s = [-1.0] * size
        self._due_s = [0.0] * size
        self._rests_s = [_BETWEEN_STARTS_S] * size
        self._slots = [ProcessSlot(index, CurrentJob()) for index in range(size)]
        self._codes: list[int | None] = [None] * size
        self.restarts = 0
        self.deaths: list[Death] = []

    def __enter__(self) -> Self:
        try:
            self.look_after()
        except BaseException:
            self.end()
            raise
        return self

    def __exit__(self, *_: object) -> None:
        self.end()

    @property
    def pids(self) -> list[int]:
        """Process ids of those who run."""
        return [p.pid for p in self._processes if p and p.is_alive() and p.pid]

    @property
    def exit_codes(self) -> list[int]:
        """How those ended that ended by themselves and rest since."""
        return [code for code in self._codes if code is not None]

    def look_after(self) -> None:
        """Start who is not there yet, and again who ended; not twice a second."""
        now_s = time.monotonic()
        for index, process in enumerate(self._processes):
            if process is not None and process.exitcode is not None:
                self._bury(index, process.exitcode, now_s)
            if self._processes[index] is None and now_s >= self._due_s[index]:
                self.restarts += self._started_s[index] >= 0.0
                self._started_s[index] = now_s
                self._codes[index] = None
                self._processes[index] = self._start(index)

    def _bury(self, index: int, code: int, now_s: float) -> None:
        """Note how a process ended, and when its place is to be taken."""
        self._processes[index] = None
        self._due_s[index] = self._started_s[index] + _BETWEEN_STARTS_S
        slot = self._slots[index]
        assert slot.note is not None
        task = slot.note.read()
        slot.note.end()
        if task is None and code >= 0:
            self._codes[index] = code
            if now_s - self._started_s[index] > _LONGEST_REST_S:
                self._rests_s[index] = _BETWEEN_STARTS_S
            self._due_s[index] = now_s + self._rests_s[index]
            self._rests_s[index] = min(2.0 * self._rests_s[index], _LONGEST_REST_S)
        elif task is not None and (cause := crash_cause(code)):
            death = Death(task, cause)
            self.deaths.append(death)
            deaths = (*slot.deaths, death)[-LAST_DEATHS:]
            self._slots[index] = replace(slot, deaths=deaths)

    def _start(self, index: int) -> SpawnProcess:
        process = self._context.Process(
            target=self._body, args=(*self._arguments, self._slots[index])
        )
        # A Ctrl-C of the terminal reaches all; only this process shall act on it. The
        # tracker first: whoever starts it lets SIGINT in again for all that follow.
        resource_tracker.ensure_running()
        before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
        try:
            process.start()
        finally:
            signal.pthread_sigmask(signal.SIG_SETMASK, before)
        return process

    def wait(self, timeout_s: float) -> None:
        """Wait until one of them ends or time is up [s]."""
        alive = [p.sentinel for p in self._processes if p and p.is_alive()]
        if alive:
            connection.wait(alive, timeout_s)
        else:
            time.sleep(min(timeout_s, _BETWEEN_STARTS_S / 10))

    def end(self) -> None:
        """Ask all to end, and end those who do not [after 10 s]."""
        there = [process for process in self._processes if process]
        for process in there:
            process.terminate()
        until_s = time.monotonic() + GRACE_S
        try:
            for process in there:
                process.join(max(0.0, until_s - time.monotonic()))
        finally:
            for process in there:
                process.kill()
                process.join()


def stop_on_signals() -> threading.Event:
    """Return an event that Ctrl-C or SIGTERM sets; Ctrl-C a second later interrupts."""
    stop = threading.Event()
    asked_s = -math.inf

    def ask(number: int, _frame: object) -> None:
        nonlocal asked_s
        now_s = time.monotonic()
        if not stop.is_set():
            asked_s = now_s
            stop.set()
        elif number == signal.SIGINT and now_s >= asked_s + _ONE_WISH_S:
            raise KeyboardInterrupt

    signal.signal(signal.SIGINT, ask)
    signal.signal(signal.SIGTERM, ask)
    return stop


def stop_with_input(stop: threading.Event) -> None:
    """Set an event when standard input ends: whoever held its other end is gone."""

    def watch() -> None:
        # Not by sys.stdin: its lock would be held when this process ends.
        while os.read(0, 1024):
            pass
        stop.set()

    threading.Thread(target=watch, daemon=True).start()


def stop_with_parent(stop: threading.Event) -> None:
    """Set an event when the process that started this one is gone.

    Whoever is still there some seconds later, because its job never ends, is ended.
    """
    parent = parent_process()
    if parent is None:
        return

    def watch() -> None:
        connection.wait([parent.sentinel])
        stop.set()
        time.sleep(GRACE_S)
        os._exit(1)

    threading.Thread(target=watch, daemon=True).start()
