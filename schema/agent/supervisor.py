"""A pool of processes that one process starts, supervises and stops.

In Linux processes are forks of a server: a new interpreter that has imported their code
but has no network session, as none survives a fork. A process that ends is restarted.
If it exited by itself outside a job, the restart is delayed, longer each time while it
exits soon after its start. No process outlives its parent. The new process of a slot is
told which jobs crashed the earlier ones.
"""

import contextlib
import ctypes
import math
import multiprocessing.util
import os
import resource
import signal
import sys
import tempfile
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from multiprocessing import connection, get_context, parent_process, resource_tracker
from multiprocessing.process import BaseProcess
from typing import Any, Self

from msgspec.structs import replace

from schema.agent.import_path import SAFE_PATH, check_graphics
from schema.agent.log import warn_user
from schema.agent.machine import core_quota
from schema.agent.stopping import catch_stop_signals
from schema.agent.supervision import LAST_DEATHS, CurrentJob, ProcessSlot, crash_cause
from schema.errors import shown
from schema.wire.messages import Crash

# Results must not depend on a library's number of threads. These count only if set
# before numpy is imported: in the parent of the pool.
_ONE_THREAD = (
    "OPENBLAS_NUM_THREADS",
    "OMP_NUM_THREADS",
    "MKL_NUM_THREADS",
    "VECLIB_MAXIMUM_THREADS",
    "NUMEXPR_NUM_THREADS",
)
# Threads of the network. One that receives blocks while it forwards a long message, so
# in what may be a hub it neither sends nor polls the sockets: the one that accepts
# connections does. An agent forwards nothing: with one for all a job costs less CPU.
HUB_THREADS = "(tx: (handover: acc))"
AGENT_THREADS = (
    "(rx: (worker_threads: 1), net: (handover: rx), acc: (handover: rx), "
    "tx: (handover: rx))"
)
# Size from which glibc maps memory separately and returns it to the system [bytes]. By
# default glibc raises it to the size of a robot's simulation, and the memory becomes
# fragmented: that of a worker grows by a tenth over 3000 births.
_MAP_BYTES = 131072
_MAPPED = "MALLOC_MMAP_THRESHOLD_"
_MAP_OPTION = -3
# Arrow's own allocator keeps what tables needed once, in each of its threads: 40 to
# 80 MB more at the end of a run.
_ARROW_POOL = "system"
# A fork starts in milliseconds and shares the memory of what is imported. Elsewhere
# libraries of the system may not survive it.
_CONTEXT = (
    get_context("forkserver") if sys.platform == "linux" else get_context("spawn")
)
_CODE = set[str]()
"""Modules that the server imports when the first pool starts."""
_UNKNOWN_CODE = 255
MOST_PER_CORE = 4
"""Processes per core that are started without being told twice."""
GRACE_S = 2.5
"""Time between asking a process to end and killing it [s]."""
_BETWEEN_STARTS_S = 1.0
_LONGEST_PAUSE_S = 30.0
# A second Ctrl-C within this time does not count.
_REPEAT_S = 1.0


def prepare_process() -> None:
    """Prepare this process and its children to share a machine with many others.

    Libraries and the network use one thread, and children do not import from the
    current folder. A process that wakes up does not interrupt one that computes, for a
    few milliseconds. Unused memory is returned to the system.
    """
    os.environ.update(dict.fromkeys((*_ONE_THREAD, SAFE_PATH), "1"))
    given = os.environ.pop("ZENOH_RUNTIME", None)
    if given is not None:
        warn_user(f"ZENOH_RUNTIME: has no effect here, got {shown(given)}")
    if _MAPPED not in os.environ:
        os.environ[_MAPPED] = str(_MAP_BYTES)  # glibc reads it at the start of children
        with contextlib.suppress(AttributeError):  # of other C libraries
            ctypes.CDLL(None).mallopt(_MAP_OPTION, _MAP_BYTES)
    os.environ.setdefault("ARROW_DEFAULT_MEMORY_POOL", _ARROW_POOL)
    # A hub has a file for each process of its fleet.
    _, most = resource.getrlimit(resource.RLIMIT_NOFILE)
    with contextlib.suppress(OSError, ValueError):
        resource.setrlimit(resource.RLIMIT_NOFILE, (most, most))
    check_graphics()
    # Where no core is free, this thread and its children wait for the scheduler's next
    # tick: a worker has its next job ready, and each interruption costs a cold cache.
    if sys.platform == "linux" and os.sched_getscheduler(0) == os.SCHED_OTHER:
        with contextlib.suppress(OSError):
            os.sched_setscheduler(0, os.SCHED_BATCH, os.sched_param(0))


def cores() -> int:
    """Return the number of cores that this process may use, or its container."""
    affinity = getattr(os, "sched_getaffinity", None)
    usable = len(affinity(0)) if affinity else os.cpu_count() or 1
    return max(1, int(min(usable, core_quota())))


def most_processes() -> int:
    """Return how many processes this machine starts without being told twice."""
    return MOST_PER_CORE * cores()


def _modules(body: Callable[..., object]) -> set[str]:
    """Return the modules of a function and of what is bound to it."""
    if not isinstance(body, partial):
        return {body.__module__}
    bound = (body.func, *body.args, *body.keywords.values())
    return set().union(*map(_modules, bound))


def _keep_sockets_short() -> None:
    """Put the server's socket into /tmp if its path would have more than 107 bytes."""
    given = tempfile.gettempdir()
    if len(os.fsencode(given)) > 107 - len("/pymp-XXXXXXXX/listener-XXXXXXXX"):
        tempfile.tempdir = "/tmp"  # noqa: S108 - in a private folder
        multiprocessing.util.get_temp_dir()
        tempfile.tempdir = given


def _exit_code(process: BaseProcess) -> int:
    """Return the exit code of a process that has ended, or whose server has.

    Python takes the end of the server for that of its forks, with code 255. They run
    on, without anybody who learns how they end, and so they are killed.
    """
    assert process.exitcode is not None
    assert process.pid is not None
    if process.exitcode != _UNKNOWN_CODE:
        return process.exitcode
    try:
        os.kill(process.pid, signal.SIGKILL)
    except ProcessLookupError:
        return process.exitcode
    return -signal.SIGKILL


@dataclass(slots=True)
class _Place:
    """A slot and its process; None: the next one is to be started at ``due_s``.

    ``pause_s`` and ``code`` are of processes that exit by themselves.
    """

    slot: ProcessSlot
    process: BaseProcess | None = None
    started_s: float = -math.inf
    due_s: float = -math.inf
    pause_s: float = _BETWEEN_STARTS_S
    code: int | None = None


class ProcessPool:
    """Processes that all run ``body(*arguments, slot)``; use it in a ``with``."""

    def __init__(
        self,
        body: Callable[..., None],
        arguments: tuple[Any, ...],
        *,
        size: int,
        role: str = "worker",
    ) -> None:
        self._body = body
        self._arguments = arguments
        self._what = f"a{'n' * (role[0] in 'aeiou')} {role} process ended"
        _CODE.update(_modules(body))
        _keep_sockets_short()
        _CONTEXT.set_forkserver_preload(sorted(_CODE))
        slots = (ProcessSlot(index, CurrentJob()) for index in range(size))
        self._places = [_Place(slot) for slot in slots]
        self._until_s: float | None = None

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
    def exit_codes(self) -> list[int]:
        """Exit codes of processes that exited by themselves and await restart."""
        return [place.code for place in self._places if place.code is not None]

    @property
    def _processes(self) -> list[BaseProcess]:
        return [place.process for place in self._places if place.process]

    def look_after(self) -> list[str]:
        """Start missing processes, each once a second at most; return what ended."""
        now_s = time.monotonic()
        lines = []
        for place in self._places:
            if place.process is not None and place.process.exitcode is not None:
                why = self._note_end(place, _exit_code(place.process), now_s)
                lines.append(f"{self._what}{why}; it is restarted")
            if place.process is None and now_s >= place.due_s:
                place.started_s, place.code = now_s, None
                place.process = self._start(place.slot)
                if place.process is None:
                    place.due_s = now_s + _BETWEEN_STARTS_S
        return lines

    def _note_end(self, place: _Place, code: int, now_s: float) -> str:
        """Note how a process ended, and when it is to be restarted; return why."""
        place.process = None
        place.due_s = place.started_s + _BETWEEN_STARTS_S
        slot = place.slot
        assert slot.note is not None
        task = slot.note.read()
        slot.note.end()
        if task is None and code >= 0:
            place.code = code
            if now_s - place.started_s > _LONGEST_PAUSE_S:
                place.pause_s = _BETWEEN_STARTS_S
            place.due_s = now_s + place.pause_s
            place.pause_s = min(2.0 * place.pause_s, _LONGEST_PAUSE_S)
            return " outside a job, for the reason that it wrote above"
        cause = crash_cause(code)
        if task is None or not cause:
            return ""
        deaths = (*slot.deaths, Crash(task, cause))[-LAST_DEATHS:]
        place.slot = replace(slot, deaths=deaths)
        return f": {task.agent} died of job {task.number} of {task.run}: {cause}"

    def _start(self, slot: ProcessSlot) -> BaseProcess | None:
        """Return a new process; None if the server is killed at this moment."""
        process = _CONTEXT.Process(target=self._body, args=(*self._arguments, slot))
        try:
            start_without_ctrl_c(process)
        except (ConnectionError, EOFError):
            return None
        return process

    def wait(self, timeout_s: float) -> None:
        """Wait until a process ends or time is up [s]."""
        alive = [p.sentinel for p in self._processes if p.is_alive()]
        if alive:
            connection.wait(alive, timeout_s)
        else:
            time.sleep(min(timeout_s, _BETWEEN_STARTS_S / 10))

    def terminate(self) -> None:
        """Ask all processes to end; ``end`` gives them the rest of the grace time."""
        if self._until_s is None:
            self._until_s = time.monotonic() + GRACE_S
        for process in self._processes:
            process.terminate()

    def end(self) -> None:
        """Terminate all processes; kill those that remain after the grace time."""
        self.terminate()
        assert self._until_s is not None
        there = self._processes
        try:
            for process in there:
                process.join(max(0.0, self._until_s - time.monotonic()))
        finally:
            for process in there:
                process.kill()
                process.join()


def stop_on_signals() -> threading.Event:
    """Return an event that a stop signal sets; Ctrl-C a second later interrupts."""
    stop = threading.Event()
    signalled_s = -math.inf

    def handle(number: int, _frame: object) -> None:
        nonlocal signalled_s
        now_s = time.monotonic()
        if not stop.is_set():
            signalled_s = now_s
            stop.set()
        elif number == signal.SIGINT and now_s >= signalled_s + _REPEAT_S:
            raise KeyboardInterrupt

    catch_stop_signals(handle)
    return stop


def stop_with_input(stop: Callable[[], object]) -> None:
    """Call a function when standard input is closed."""

    def watch() -> None:
        # Not by sys.stdin: its lock would be held when this process ends.
        while os.read(0, 1024):
            pass
        stop()

    threading.Thread(target=watch, daemon=True).start()


def start_without_ctrl_c(process: BaseProcess) -> None:
    """Start a process that a Ctrl-C in the terminal does not reach.

    The terminal sends it to all processes; only this one may act on it.
    """
    # The tracker first: starting it unblocks SIGINT.
    resource_tracker.ensure_running()
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        process.start()
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def stop_with_parent(stop: Callable[[], object]) -> None:
    """Call a function when the process that started this one is gone.

    This process exits if it still runs after a grace time: its job may not end.
    """
    parent = parent_process()
    if parent is None:
        return

    def watch() -> None:
        connection.wait([parent.sentinel])
        stop()
        time.sleep(GRACE_S)
        os._exit(1)

    threading.Thread(target=watch, daemon=True).start()
