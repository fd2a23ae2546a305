"""Processes that the Python API starts, as its process sees them.

They are started by ``subprocess``: nothing is forked, and the user's main module is not
imported again. They end with this process, however it ends, and a Ctrl-C of the
terminal does not reach them.
"""

import atexit
import os
import signal
import subprocess
import threading
from collections.abc import Sequence
from multiprocessing.connection import Connection, Pipe

import msgspec

from revolve.arguments import naming_arguments
from revolve.messages import Outcome, Problem, Task, error_of
from schema.agent.import_path import environment, python_command
from schema.agent.stopping import STOPPED
from schema.agent.supervision import crash_cause
from schema.errors import RevolveError
from schema.plugins.source import forget_digests, plugins_of

_GRACE_S = 6.0
"""Longer than a command waits for the processes that it has started [s]."""
_OUTCOMES = msgspec.msgpack.Decoder(Outcome)
_PROBLEMS = msgspec.msgpack.Decoder(Problem)


def start(
    module: str, *words: str, is_quiet: bool = False, files: Sequence[int] = ()
) -> "subprocess.Popen[bytes]":
    """Start a module of ours in a process that ends when its input is closed."""
    return subprocess.Popen(
        [*python_command(module), *words],
        stdin=subprocess.PIPE,
        stdout=subprocess.DEVNULL if is_quiet else None,
        pass_fds=files,
        env=environment(),
        start_new_session=True,
    )


def end(process: "subprocess.Popen[bytes]") -> None:
    """Close a process's input, so that it ends; kill its session after a grace time."""
    assert process.stdin is not None
    process.stdin.close()
    try:
        process.wait(_GRACE_S)
    except subprocess.TimeoutExpired:
        os.killpg(process.pid, signal.SIGKILL)
        process.wait()


class Child:
    """Process that runs ``revolve.child``; ends with ``end``."""

    def __init__(self, words: Sequence[str], *, is_quiet: bool = False) -> None:
        self.connection, theirs = Pipe()
        with theirs:
            file = theirs.fileno()
            self.process = start(
                "revolve.child", str(file), *words, is_quiet=is_quiet, files=[file]
            )

    def end(self) -> None:
        """Let the process end; kill it after a grace time."""
        self.connection.close()
        end(self.process)


class Workers:
    """The command ``revolve worker``, which starts and restarts processes.

    It ends when its standard input is closed: by ``close``, or with this process,
    however it ends. A Ctrl-C of the terminal does not reach it.
    """

    def __init__(self, address: str, count: int, plugins: Sequence[str]) -> None:
        """Start processes that serve a hub and may import some modules and files."""
        self.plugins = tuple(plugins)
        words = [word for entry in plugins for word in ("--plugins", entry)]
        given = ["--connect", address, "--processes", str(count), "--until-closed"]
        self._process = start("revolve", "worker", *given, *words)

    @property
    def exit_code(self) -> int | None:
        """Exit code; None while it runs."""
        return self._process.poll()

    def close(self) -> None:
        """Tell it to end; its processes finish their jobs."""
        assert self._process.stdin is not None
        self._process.stdin.close()

    def end(self) -> None:
        """Wait for its end; kill it and its processes after a grace time."""
        end(self._process)


def run_command(words: Sequence[str], *, is_quiet: bool = True) -> int:
    """Run a command of ``revolve`` in a process of its own; return its exit code.

    Raises:
        RevolveError: the command's error, of the same class, or the line that it has
            written about a wrong argument.
        KeyboardInterrupt: after Ctrl-C; the command has stopped as after its own.
    """
    child = Child(("command", *words), is_quiet=is_quiet)
    try:
        try:
            code = child.process.wait()
        except KeyboardInterrupt:
            child.process.send_signal(signal.SIGINT)
            child.process.wait()
            raise
        problem = _received(child.connection)
    finally:
        child.end()
    if problem is not None:
        with naming_arguments():
            raise error_of(_PROBLEMS.decode(problem))
    if code not in (0, 1):
        raise RevolveError(f"revolve {words[0]} ended with exit code {code}")
    return code


def _received(connection: Connection) -> bytes | None:
    try:
        return connection.recv_bytes() if connection.poll() else None
    except (EOFError, ConnectionError):
        return None


class Simulator:
    """The process that simulates single robots; started with the first task.

    A process that was forked from this one starts its own. A plug-in whose source has
    changed is imported again, in a new process.
    """

    def __init__(self) -> None:
        self._child: Child | None = None
        self._owner = 0
        self._sources: dict[str, str] = {}
        self._lock = threading.Lock()
        atexit.register(self.end)

    def do(self, task: Task) -> Outcome:
        """Return the outcome of a task.

        Raises:
            RevolveError: the task cannot be done; of the class that the worker raises.
            KeyboardInterrupt: Ctrl-C, or raised by a plug-in; the process has ended.
        """
        with self._lock:
            self._note_sources(task.settings)
            try:
                if self._child is None or self._owner != os.getpid():
                    self._child, self._owner = Child(("simulate",)), os.getpid()
                child = self._child
                child.connection.send_bytes(msgspec.msgpack.encode(task))
                outcome = _OUTCOMES.decode(child.connection.recv_bytes())
            except (EOFError, ConnectionError):
                return Outcome(failure=self._death())
            except BaseException:
                # Its answer to this task would be taken for that to the next one.
                self.end()
                raise
        if outcome.problem is not None:
            raise error_of(outcome.problem)
        return outcome

    def _note_sources(self, settings: bytes) -> None:
        """End the process if it may have imported an earlier source of a plug-in."""
        forget_digests()
        for each in plugins_of(settings).split():
            name, _, digest = each.partition("=")
            if self._sources.setdefault(name, digest) != digest:
                self.end()
                self._sources = {name: digest}

    def _death(self) -> str:
        """Return why the process has ended, and forget it."""
        assert self._child is not None
        code = self._child.process.wait()
        self._child.end()
        self._child = None
        if code == STOPPED:
            raise KeyboardInterrupt from None
        return f"ended its own process, by {crash_cause(code) or 'a signal'}"

    def end(self) -> None:
        """End the process, if there is one."""
        if self._child is not None and self._owner == os.getpid():
            self._child.process.kill()
            self._child.end()
        self._child = None


SIMULATOR = Simulator()
