"""Commands as forks of an interpreter that has imported all modules.

A start takes milliseconds instead of a second. A program imports this module first, and
itself opens no Zenoh session and starts no thread: neither survives a fork. Each
command is a process of its own, which SIGKILL ends like any other.
"""

import ctypes
import os
import signal
import sys
import time
import traceback
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

from schema.agent import supervisor

supervisor.prepare_process()

import analyzer.__main__  # noqa: E402
import analyzer.service  # noqa: E402, F401 - before the first fork
import coordinator.__main__  # noqa: E402
import coordinator.cli.hub  # noqa: E402
import worker.__main__  # noqa: E402
import worker.serve.service  # noqa: E402, F401
from coordinator.cli import main_loop  # noqa: E402
from schema.errors import RevolveError  # noqa: E402

PATIENCE_S = 600.0
_MAINS: dict[str, Callable[[list[str]], int]] = {
    "analyzer": analyzer.__main__.main,
    "worker": worker.__main__.main,
    "hub": coordinator.cli.hub.main,
}
_DIE_WITH_PARENT = 1


def start(
    words: list[str],
    log: Path,
    before: Callable[[], object] = lambda: None,
    after: Callable[[], object] = lambda: None,
) -> int:
    """Start a command as a fork of this process; return its process id."""
    sys.stdout.flush()
    child = os.fork()
    if child:
        return child
    code = 99
    try:
        ctypes.CDLL(None).prctl(_DIE_WITH_PARENT, signal.SIGKILL)
        file = os.open(log, os.O_WRONLY | os.O_APPEND | os.O_CREAT)
        for descriptor in (1, 2):
            os.dup2(file, descriptor)
        _hurry()
        before()
        code = _run(words)
        after()
    except BaseException:  # noqa: BLE001 - the end of the process
        traceback.print_exc()
    finally:
        with suppress(OSError):
            sys.stdout.flush()
            sys.stderr.flush()
        os._exit(code)


def _run(words: list[str]) -> int:
    sys.stderr.write(f"process {os.getpid()}: {' '.join(words)}\n")
    try:
        return _MAINS.get(words[0], coordinator.__main__.main)(words)
    except RevolveError as error:
        sys.stderr.write(f"revolve: {error}\n")
        return 2


def _hurry() -> None:
    """Flush tables more often than once a second."""
    main_loop._CHORES_S = 0.05


def ended(process: int) -> int | None:
    """Return the exit code of a command, negative for a signal; None if it runs."""
    done, status = os.waitpid(process, os.WNOHANG)
    return os.waitstatus_to_exitcode(status) if done else None


def wait(process: int, log: Path) -> int:
    """Wait for the end of a command; return its exit code."""
    deadline = time.monotonic() + PATIENCE_S
    while (code := ended(process)) is None:
        if time.monotonic() > deadline:
            kill(process)
            raise TimeoutError(f"a command does not end:\n{tail(log)}")
        time.sleep(0.001)  # polling interval
    return code


def wait_for(text: str, log: Path) -> None:
    """Wait until a log contains a text."""
    deadline = time.monotonic() + PATIENCE_S
    while not (log.exists() and text in log.read_text("utf-8", errors="replace")):
        if time.monotonic() > deadline:
            raise TimeoutError(f"never came: {text}\n{tail(log)}")
        time.sleep(0.001)  # polling interval


def kill(process: int) -> int:
    """Kill a command; return its exit code, which differs if it had just ended."""
    with suppress(ProcessLookupError):
        os.kill(process, signal.SIGKILL)
    return os.waitstatus_to_exitcode(os.waitpid(process, 0)[1])


def tail(log: Path) -> str:
    """Return the last lines of a log."""
    return "\n".join(log.read_text("utf-8", errors="replace").splitlines()[-30:])
