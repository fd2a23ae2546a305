"""Destinations of a recording: a file, a server for viewers, or a window."""

import contextlib
import getpass
import os
import shlex
import socket
import subprocess
import threading
from dataclasses import dataclass
from pathlib import Path
from urllib.parse import quote

from analysis.render.flags import FILM_ENDINGS
from analysis.viewer.flags import HOST
from analysis.viewer.recording import Recording, ViewerError
from schema.agent.import_path import missing_screen, python_command
from schema.agent.log import tell_user

WITHOUT_SCREEN = (
    "use --save FILE.rrd for a recording that 'rerun FILE.rrd' opens elsewhere, or "
    "--serve, which tells how to view through an SSH tunnel or in a browser"
)
"""Advice on a machine without a screen."""
_LOOPBACK = ("127.0.0.1", "localhost")
_WEB = 9090
_ENDING = ".rrd"
_WINDOW_S = 3.0
_POLL_S = 0.2


@dataclass(frozen=True, slots=True)
class Output:
    """Destinations of a recording.

    Attributes:
        file: file to write, or None.
        serve: host and port to serve viewers at, or None.
        has_window: open a viewer's window.
    """

    file: Path | None
    serve: tuple[str, int] | None
    has_window: bool

    @classmethod
    def of(cls, save: Path | None, serve: str | None) -> "Output":
        """Return the destinations of two flags; a window if neither is given.

        Raises:
            ViewerError: the address is invalid or in use, the folder does not exist,
                the file does not end in .rrd, or a window needs a screen.
        """
        if save is not None and save.suffix != _ENDING:
            raise ViewerError(
                f"--save {save}: must end in {_ENDING}, or {', '.join(FILM_ENDINGS)} "
                "or .html for an arena"
            )
        if save is not None and not save.absolute().parent.is_dir():
            raise ViewerError(f"--save {save}: no such folder: {save.parent}")
        if serve is not None or save is not None:
            address = None if serve is None else _address(serve)
            return cls(save, address, has_window=False)
        if why := missing_screen():
            raise ViewerError(f"{why}: {WITHOUT_SCREEN}")
        return cls(None, (HOST, _free_port()), has_window=True)

    @property
    def url(self) -> str:
        """Address that viewers connect to; empty without a server."""
        if self.serve is None:
            return ""
        return f"rerun+http://{self.serve[0]}:{self.serve[1]}/proxy"


class Window:
    """A viewer's window, if requested; it stays open after this process ends."""

    def __init__(self, output: Output) -> None:
        """Open the window, or print the address that viewers connect to.

        Raises:
            ViewerError: the window cannot be opened, probably for lack of a screen.
        """
        self._process: subprocess.Popen[bytes] | None = None
        if not output.has_window:
            if output.url:
                for line in ways_to_view(output):
                    tell_user(line)
            return
        # The viewer's own server, which is not used, listens on this machine only.
        viewer = python_command("rerun")
        _decline_statistics(viewer)
        self._process = subprocess.Popen(  # noqa: S603 - our own interpreter
            [*viewer, "--bind", HOST, "--connect", output.url],
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )
        with contextlib.suppress(subprocess.TimeoutExpired):
            self._process.wait(_WINDOW_S)
        _ = self.was_closed

    @property
    def was_closed(self) -> bool:
        """Whether a window was opened and has been closed.

        Raises:
            ViewerError: the window could not be opened; a slow machine reports it late.
        """
        ended = None if self._process is None else self._process.poll()
        if ended is not None and ended > 0:
            raise ViewerError(f"the viewer cannot open a window: {WITHOUT_SCREEN}")
        return ended is not None


def _decline_statistics(viewer: list[str]) -> None:
    """Turn Rerun's usage statistics off, unless the user has chosen."""
    folder = os.environ.get("XDG_CONFIG_HOME") or Path.home() / ".config"
    if (Path(folder) / "rerun" / "analytics.json").exists():
        return
    command = [*viewer, "analytics", "disable"]
    done = subprocess.run(command, capture_output=True, check=False)  # noqa: S603 - our own interpreter
    if done.returncode == 0:
        tell_user("Rerun sends no usage statistics; to send: rerun analytics enable")


def ways_to_view(output: Output) -> list[str]:
    """Return lines about the viewers that can show what is served."""
    assert output.serve is not None
    host, port = output.serve
    lines = [f"serving; to view: rerun --connect {output.url}"]
    tunnel = ""
    if host in _LOOPBACK:
        to = socket.gethostname()
        # A user of a container may have no name; the error depends on the version.
        with contextlib.suppress(KeyError, OSError):
            to = f"{getpass.getuser()}@{to}"
        lines.append(
            f"from another machine: ssh -N -L {port}:{host}:{port} {to}, and there the "
            "same"
        )
        tunnel = f"; through SSH: -L {port}:{host}:{port} -L {_WEB}:{host}:{_WEB}"
    page = f"http://{host}:{_WEB}?url={quote(output.url, safe='')}"
    lines.append(
        f"in a browser: rerun --serve-web --bind {host} --web-viewer-port {_WEB} "
        f"{output.url}, then open {page}{tunnel}"
    )
    return lines


def keep_serving(
    output: Output, window: Window, recording: Recording, stop: threading.Event
) -> None:
    """Keep serving a complete recording until the user stops or closes the viewer."""
    recording.flush()
    if output.file is not None:
        command = shlex.join(["rerun", str(output.file)])
        tell_user(f"saved {output.file}; to view: {command}")
    if output.serve is None:
        return
    if not (output.has_window or stop.is_set()):
        tell_user("recording complete; press Ctrl-C to stop")
    while not (stop.is_set() or window.was_closed):
        stop.wait(_POLL_S)


def _address(text: str) -> tuple[str, int]:
    host, _, port = text.rpartition(":")
    if not (host and port.isdigit() and int(port) < 1 << 16):
        raise ViewerError(f"--serve: must be HOST:PORT, got {text!r}")
    with socket.socket() as probe:
        probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            probe.bind((host, int(port)))
        except OSError as error:
            raise ViewerError(f"--serve {text}: {error.strerror}") from None
    return host, int(port)


def _free_port() -> int:
    with socket.socket() as probe:
        probe.bind((HOST, 0))
        port: int = probe.getsockname()[1]
        return port
