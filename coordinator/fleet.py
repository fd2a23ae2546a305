"""Workers and an analyzer started as processes of this machine, for one run."""

import contextlib
import subprocess
import sys
from pathlib import Path
from types import TracebackType

_PATIENCE_S = 10.0


class LocalFleet:
    """Child processes that serve a coordinator and end with it.

    Each child holds the reading end of a pipe from this process and stops when the
    pipe closes, so that even a killed coordinator leaves no orphans behind.
    """

    def __init__(self, address: str, *, workers: int, fleet: str, log: Path) -> None:
        """Plan the children; ``with`` starts them.

        Args:
            address: where the coordinator's hub listens.
            workers: number of worker processes, one slot each.
            fleet: name of the fleet that they join.
            log: file that takes what they say.
        """
        base = [sys.executable, "-m", "revolve"]
        ending = ["--connect", address, "--fleet", fleet, "--until-closed"]
        self._commands = [
            [*base, "analyzer", *ending],
            [*base, "worker", "--processes", str(workers), *ending],
        ]
        self._log = log
        self._children: list[subprocess.Popen[bytes]] = []

    def __enter__(self) -> "LocalFleet":
        """Start the children."""
        with self._log.open("ab") as log:
            self._children = [
                subprocess.Popen(  # noqa: S603 - our own command, no shell
                    command,
                    stdin=subprocess.PIPE,
                    stdout=log,
                    stderr=log,
                    # Ctrl-C reaches the coordinator alone; it ends the children.
                    start_new_session=True,
                )
                for command in self._commands
            ]
        return self

    def ended(self) -> list[str]:
        """Return the roles of children that have ended by themselves."""
        return [
            command[3]
            for command, child in zip(self._commands, self._children, strict=True)
            if child.poll() is not None
        ]

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        """Close the pipes, wait, and kill whoever does not end."""
        for child in self._children:
            if child.stdin is not None:
                with contextlib.suppress(OSError):
                    child.stdin.close()
        for child in self._children:
            try:
                child.wait(_PATIENCE_S)
            except subprocess.TimeoutExpired:
                child.kill()
                child.wait()
