"""Commands of a test, started as a user starts them, in their own folder."""

import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

PATIENCE_S = 240.0


class Stage:
    """Starts the commands of one test in one folder and ends those that remain."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self._started: list[subprocess.Popen[str]] = []

    def start(
        self,
        *words: str,
        folder: Path | None = None,
        environment: dict[str, str] | None = None,
        inside: str = "",
    ) -> subprocess.Popen[str]:
        """Start ``revolve`` with these words and return at once.

        Args:
            words: of the command line.
            folder: where, instead of the stage's own.
            environment: variables besides those that are set.
            inside: a network namespace.
        """
        prefix = ("ip", "netns", "exec", inside) if inside else ()
        process = subprocess.Popen(
            [*prefix, sys.executable, "-m", "revolve", *words],
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            cwd=folder or self.folder,
            env={
                **os.environ,
                "PYTHONPATH": str(Path(__file__).parents[2]),
                **(environment or {}),
            },
        )
        self._started.append(process)
        return process

    def run(self, *words: str, code: int = 0) -> str:
        """Run ``revolve`` to its end; return what it printed, both streams."""
        process = self.start(*words)
        out, err = process.communicate(timeout=PATIENCE_S)
        assert process.returncode == code, f"{words}: {process.returncode}\n{out}{err}"
        return out + err

    def clear(self) -> None:
        """Kill remaining processes; if the test failed, show their output."""
        for process in self._started:
            if process.poll() is None:
                process.send_signal(signal.SIGCONT)
                process.kill()
            out, err = process.communicate()
            sys.stdout.write(f"{process.args!r}: {process.returncode}\n{out}{err}\n")


def wait_until(condition: Callable[[], bool], what: str) -> None:
    """Return once a condition holds; fail the test if it never does."""
    deadline = time.monotonic() + PATIENCE_S
    while not condition():
        assert time.monotonic() < deadline, f"never happened: {what}"
        time.sleep(0.005)  # the interval of looking, not a wait for luck
