"""Worker processes of a fleet on this machine: the command ``revolve worker``."""

from collections.abc import Sequence

from revolve.children import end, start


class Workers:
    """The command ``revolve worker``, which starts and restarts processes.

    It ends when its standard input is closed: by ``close``, or with this process,
    however it ends. A Ctrl-C of the terminal does not reach it.

    Attributes:
        plugins: modules that the workers may import.
    """

    def __init__(self, address: str, count: int, plugins: Sequence[str]) -> None:
        """Start the command.

        Args:
            address: of the hub.
            count: number of processes.
            plugins: modules and files that they may import.
        """
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
