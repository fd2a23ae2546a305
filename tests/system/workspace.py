"""Runs the commands of a test as a user does, in a separate folder."""

import atexit
import os
import re
import secrets
import signal
import socket
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from contextlib import ExitStack, suppress
from pathlib import Path
from typing import Any

from tests.command import command

PATIENCE_S = 600.0
_READ_LATE = ("REVOLVE_", "XDG_")
"""Beginnings of variables that a command reads when it needs them."""
Process = Any
"""A ``subprocess.Popen[str]``; mypy does not know that its pipes are there."""


def runtime_directory(folder: Path) -> str:
    """Return a directory for the sockets of a test, by a path that is short enough."""
    (folder / "runtime").mkdir(exist_ok=True)
    link = Path(tempfile.gettempdir()) / f"rt-{secrets.token_hex(6)}"
    link.symlink_to(folder / "runtime")
    atexit.register(link.unlink)
    return str(link)


def said(text: str) -> list[str]:
    """Return lines of a log without their time and level."""
    stamp = re.compile(r"^\d{4}-\d\d-\d\d \d\d:\d\d:\d\d [a-z]+: ")
    return [stamp.sub("", line) for line in text.splitlines()]


def free_address(protocol: str = "tcp") -> str:
    """Return an address of this machine at which no process listens."""
    with socket.create_server(("127.0.0.1", 0)) as server:
        return f"{protocol}/127.0.0.1:{server.getsockname()[1]}"


def address_of(run: Path) -> str:
    """Return the address of a run's hub, as soon as it listens."""
    file = run / "address"
    wait_until(file.exists, "the coordinator listens")
    return file.read_text().split()[0]


class Forked:
    """Command of a forked process: signals are sent to it, all else is of its client.

    Attributes:
        pid: of the command.
    """

    def __init__(self, client: Process, pid: int) -> None:
        self._client, self.pid = client, pid

    def __getattr__(self, name: str) -> Any:  # noqa: ANN401 - of the client
        return getattr(self._client, name)

    def send_signal(self, number: int) -> None:
        """Send a signal, unless the command has ended."""
        if self._client.poll() is None:
            with suppress(ProcessLookupError):
                os.kill(self.pid, number)

    def terminate(self) -> None:
        """Send SIGTERM."""
        self.send_signal(signal.SIGTERM)

    def kill(self) -> None:
        """Send SIGKILL."""
        self.send_signal(signal.SIGKILL)


class Workspace:
    """Starts the commands of a test in a folder and kills remaining processes.

    Each leads a session of its own, as in a terminal. All of them get the variables in
    ``environment``.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.environment: dict[str, str] = {}
        self._started: list[tuple[Process, Path | None]] = []

    def start(
        self,
        *words: str,
        folder: Path | None = None,
        environment: dict[str, str] | None = None,
        inside: str = "",
        module: str = "revolve",
        log: Path | None = None,
    ) -> Process:
        """Start ``revolve``, or another module, and return immediately.

        It is a new interpreter if it is another module, or has a network namespace or
        variables of its own that are read at its start; otherwise a fork.
        """
        own = {**self.environment, **(environment or {})}
        is_own = inside or any(not name.startswith(_READ_LATE) for name in own)
        if is_own or module != "revolve" or sys.platform != "linux":
            prefix = ("ip", "netns", "exec", inside) if inside else ()
            new = (*prefix, sys.executable, "-m", module, *words)
            return self.start_command(
                *new, folder=folder, environment=environment, log=log
            )
        receiver, teller = os.pipe()
        client = self.start_command(
            *command(teller), *words,
            folder=folder, environment=environment, log=log, files=(teller,),
        )  # fmt: skip
        os.close(teller)
        with open(receiver) as told:  # noqa: PTH123 - an open file
            return Forked(client, int(told.read()))

    def start_command(
        self,
        *words: str,
        folder: Path | None = None,
        environment: dict[str, str] | None = None,
        log: Path | None = None,
        files: tuple[int, ...] = (),
    ) -> Process:
        """Start any command, otherwise like ``start``; it keeps ``files`` open."""
        root = {"PYTHONPATH": str(Path(__file__).parents[2])}
        with ExitStack() as opened:
            file = opened.enter_context(log.open("w")) if log else subprocess.PIPE
            process = subprocess.Popen(
                words,
                stdin=subprocess.PIPE,
                stdout=file,
                stderr=file,
                text=True,
                start_new_session=True,
                pass_fds=files,
                cwd=folder or self.folder,
                env={**os.environ, **root, **self.environment, **(environment or {})},
            )
        self._started.append((process, log))
        return process

    def run(self, *words: str, code: int = 0) -> str:
        """Run ``revolve`` to its end; return standard output and standard error."""
        return self._finish(self.start(*words), code)

    def finished(self, document: str, births: int, name: str) -> Path:
        """Run a document to its end, in one process; return the run's folder."""
        (self.folder / "x.toml").write_text(document)
        words = ("--seed", "3", "--births", str(births), "--in-process", "--quiet")
        self.run("run", "x.toml", *words, "--out", name)
        return self.folder / name

    def python(self, *words: str, code: int = 0) -> str:
        """Run Python with arguments to its end; return all that it writes."""
        return self._finish(self.start_command(sys.executable, *words), code)

    def _finish(self, process: Process, code: int) -> str:
        out, err = process.communicate(timeout=PATIENCE_S)
        failure = f"{process.args}: {process.returncode}\n{out}{err}"
        assert process.returncode == code, failure
        told: str = out + err
        return told

    def clear(self) -> None:
        """Kill remaining processes and write all output to the test report."""
        for process, log in self._started:
            with suppress(ProcessLookupError):
                os.killpg(process.pid, signal.SIGKILL)
            out, err = process.communicate()
            if log is not None:
                out, err = log.read_text("utf-8", "replace"), ""
            sys.stdout.write(f"{process.args!r}: {process.returncode}\n{out}{err}\n")


def wait_until(
    condition: Callable[[], bool], what: str, patience_s: float = PATIENCE_S
) -> None:
    """Wait until a condition holds; fail the test after a timeout."""
    deadline = time.monotonic() + patience_s
    while not condition():
        assert time.monotonic() < deadline, f"never happened: {what}"
        time.sleep(0.005)  # polling interval
