"""Signals that stop a command, and the time limit within which it ends.

A terminal sends SIGINT and SIGHUP, service managers SIGTERM, batch systems SIGUSR1,
SIGUSR2 or SIGXCPU before the walltime ends. SIGHUP has no effect on a command that
``nohup`` started.
"""

import os
import shlex
import signal
import sys
import threading
import time
from collections.abc import Callable
from contextlib import suppress
from multiprocessing import active_children, parent_process
from pathlib import Path
from types import FrameType

STOP_SIGNALS = (
    *(signal.SIGINT, signal.SIGTERM, signal.SIGHUP),
    *(signal.SIGUSR1, signal.SIGUSR2, signal.SIGXCPU),
)
LIMIT_S = 4.0
"""Time after the first signal at which a command is ended with its children [s]."""
STOPPED = 130
"""Exit code of a command that a signal stopped."""

_ADVICE: list[str] = []
_FINAL: list[str] = []
_TOLD: list[str] = []
_RECEIVED: list[int] = []


def catch_stop_signals(handle: Callable[[int, FrameType | None], object]) -> None:
    """Install a handler of all stop signals; an ignored SIGHUP stays ignored."""

    def received(number: int, frame: FrameType | None) -> None:
        _RECEIVED.append(number)
        handle(number, frame)

    for number in STOP_SIGNALS:
        is_ignored = signal.getsignal(number) == signal.SIG_IGN
        if not (number == signal.SIGHUP and is_ignored):
            signal.signal(number, received)


def prepare_stop(words: list[str]) -> None:
    """Let stop signals interrupt this command, and end it after the time limit.

    Call it in the main thread. The first signal raises ``KeyboardInterrupt`` unless
    the command installs another handler.
    """
    advise(f"stopped; to start again: {shlex.join(['revolve', *words])}")

    def interrupt(_number: int, _frame: FrameType | None) -> None:
        if len(_RECEIVED) == 1:
            raise KeyboardInterrupt

    catch_stop_signals(interrupt)
    # Written by the interpreter at once, even while the main thread is in a library.
    reader, writer = os.pipe()
    os.set_blocking(writer, False)
    signal.set_wakeup_fd(writer, warn_on_full_buffer=False)
    threading.Thread(target=_end_in_time, args=(reader,), daemon=True).start()


def finish_stop() -> None:
    """Say how to go on if a signal has stopped the command; ignore further Ctrl-C."""
    for number in STOP_SIGNALS:
        if callable(signal.getsignal(number)):
            is_ctrl_c = number == signal.SIGINT
            signal.signal(number, signal.SIG_IGN if is_ctrl_c else signal.SIG_DFL)
    if _RECEIVED:
        tell_stopped()


def advise(line: str, *, is_final: bool = False) -> None:
    """Set the line that tells the user how to go on after a stop.

    ``is_final``: that of a command which calls others keeps its own.
    """
    if not _FINAL:
        _ADVICE[:] = [line]
        _TOLD.clear()
    _FINAL.extend([line] * is_final)


def tell_stopped() -> None:
    """Tell the user, once, how to go on after a stop; not in a child process."""
    if _ADVICE and not _TOLD and parent_process() is None:
        _TOLD.append(_ADVICE[0])
        with suppress(OSError):
            sys.stderr.write(f"{_ADVICE[0]}\n")
            sys.stderr.flush()


def _end_in_time(reader: int) -> None:
    """Wait for a stop signal, then end this process and its children in time."""
    while not any(number in STOP_SIGNALS for number in os.read(reader, 64)):
        pass
    time.sleep(LIMIT_S)
    for child in active_children():
        child.kill()
    for process in _descendants(os.getpid()):
        with suppress(OSError):
            os.kill(process, signal.SIGKILL)
    tell_stopped()
    os._exit(STOPPED)


def _descendants(process: int) -> list[int]:
    """Return the processes of this session below a process; only Linux lists them."""
    below: dict[int, list[int]] = {}
    session = os.getsid(0)
    for entry in Path("/proc").glob("[0-9]*/stat"):
        with suppress(OSError, ValueError):
            # The name before may contain spaces and brackets.
            _, parent, _, own = entry.read_text().rpartition(")")[2].split()[:4]
            if int(own) == session:
                below.setdefault(int(parent), []).append(int(entry.parent.name))
    descendants, open_ = [], [process]
    while open_:
        children = below.get(open_.pop(), [])
        descendants += children
        open_ += children
    return descendants
