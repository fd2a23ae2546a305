"""Server of ``tests/command.py``: it forks for each command.

It has one thread, no session of the network and no library of graphics, as these do not
survive a fork. It ends with the process that started it.
"""

import atexit
import gc
import importlib
import json
import os
import pkgutil
import runpy
import selectors
import signal
import socket
import subprocess
import sys
import tempfile
import traceback
from collections.abc import Sequence
from contextlib import suppress
from functools import lru_cache
from multiprocessing import forkserver, resource_tracker, util
from pathlib import Path
from unittest.mock import patch

from schema.agent.import_path import GRAPHICS, NO_GRAPHICS
from schema.agent.supervisor import prepare_process
from tests.command import MOST_BYTES

_ROOMS = ("schema", "coordinator", "worker", "analyzer", "analysis", "revolve")
_OF_ARROW = "jemalloc_bg_thd"
"""Thread of Arrow's allocator, which starts again in a fork."""
_DRAWING = ("analyze", "robot")
"""Commands that choose a library of graphics before they import MuJoCo."""
_WITH_AGENTS = ("run", "resume", "worker", "analyzer", "suite")
"""Commands that may start agents."""
ADDRESS = "REVOLVE_COMMAND_SERVER"
"""Environment variable: socket of the server of the process that started this one."""


@lru_cache(maxsize=1)
def address() -> str:
    """Start the server of this process, once; return the path of its socket."""
    if ADDRESS in os.environ:
        return os.environ[ADDRESS]
    folder = tempfile.TemporaryDirectory(prefix="commands-")
    atexit.register(folder.cleanup)
    path = f"{folder.name}/socket"
    top = str(Path(__file__).parents[1])
    server = subprocess.Popen(
        [sys.executable, "-m", "tests.command_server", path],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        cwd=top,
        env={**os.environ, "PYTHONPATH": top},
        start_new_session=True,  # Ctrl-C is for pytest, whose end it sees
    )
    assert server.stdin is not None
    assert server.stdout is not None
    assert server.stdout.readline() == b"ready\n"
    atexit.register(server.wait)
    atexit.register(server.stdin.close)
    return path


def _import_all() -> None:
    """Import all modules of the product but those of Rerun, which starts threads."""
    prepare_process()
    for room in map(importlib.import_module, _ROOMS):
        for module in pkgutil.walk_packages(room.__path__, f"{room.__name__}."):
            if module.name != "revolve.__main__" and "viewer" not in module.name:
                importlib.import_module(module.name)


def _fork(_path: object, words: Sequence[str], files: Sequence[int]) -> int:
    """Fork a process that executes the code of a new interpreter; return its id.

    It has standard files and ``files`` alone.
    """
    process = os.fork()
    if process:
        return process
    code = 1
    try:
        for file in map(int, os.listdir("/proc/self/fd")):  # noqa: PTH208 - open
            if file not in {0, 1, 2, *files}:
                with suppress(OSError):
                    os.close(file)
        with suppress(SystemExit):
            exec(words[-1], {})  # noqa: S102 - what Python's interpreter would execute
        code = 0
    except BaseException:  # noqa: BLE001 - as the interpreter
        traceback.print_exc()
    finally:
        os._exit(code)


def _serve_agents() -> None:
    """Start multiprocessing's server of agents for this command, as a fork of it.

    It has all modules, and no session of the network, which comes later.
    """
    resource_tracker.ensure_running()
    forkserver.set_forkserver_preload([])
    with patch.object(util, "spawnv_passfds", _fork):
        forkserver.ensure_running()


class _Server:
    """Forks for requests, and answers each with the exit code of its command."""

    def __init__(self, listener: socket.socket) -> None:
        self._listener = listener
        self._waiting = selectors.DefaultSelector()
        self._waiting.register(listener, selectors.EVENT_READ)
        self._waiting.register(0, selectors.EVENT_READ)

    def serve(self) -> None:
        """Answer until standard input ends; return in each process of a command."""
        while True:
            for key, _ in self._waiting.select():
                if self._waiting.get_map().get(key.fd) is not key:
                    continue  # Its command has ended in this turn.
                if key.fileobj == 0:
                    for other in self._waiting.get_map().values():
                        self._kill(other)
                    return
                if key.fileobj is self._listener:
                    if self._accept():
                        return
                elif isinstance(key.fileobj, socket.socket):
                    # The client is gone, as otherwise it sends nothing more.
                    self._waiting.unregister(key.fileobj)
                    self._kill(key)
                else:
                    self._end(key.fd, *key.data)

    def _accept(self) -> bool:
        """Fork for a request; return whether this is the process of the command."""
        client, _ = self._listener.accept()
        request, files, _, _ = socket.recv_fds(client, MOST_BYTES, 3)
        process = os.fork()
        if not process:
            others = [key.fileobj for key in self._waiting.get_map().values()]
            self._waiting.close()
            for other in (*others, client):
                if isinstance(other, socket.socket):
                    other.close()
                elif isinstance(other, int) and other > 0:
                    os.close(other)  # of a process, not standard input
            self._become(files, *json.loads(request))
            return True
        for file in files:
            os.close(file)
        with suppress(ConnectionError):
            client.send(str(process).encode())
        self._waiting.register(client, selectors.EVENT_READ, process)
        ended = os.pidfd_open(process)
        self._waiting.register(ended, selectors.EVENT_READ, (process, client))
        return False

    def _become(
        self,
        files: list[int],
        words: list[str],
        folder: str,
        environment: dict[str, str],
    ) -> None:
        """Make this process that of a command."""
        for target, file in enumerate(files):
            os.dup2(file, target)
            os.close(file)
        os.setsid()
        os.chdir(folder)
        os.environ.clear()
        os.environ.update(environment)
        if words[0] in _DRAWING:
            # A new interpreter does this when it first imports MuJoCo.
            engine = importlib.import_module("analysis.render.stage")._installed()
            os.environ.setdefault(GRAPHICS, engine or NO_GRAPHICS)
            importlib.reload(sys.modules["mujoco.rendering.classic.gl_context"])
        sys.argv[1:] = words
        sys.path[0] = folder
        if words[0] in _WITH_AGENTS:
            _serve_agents()

    @staticmethod
    def _kill(client: selectors.SelectorKey) -> None:
        """Kill the command of a client, with the processes of its group."""
        if isinstance(client.data, int):
            # It may not lead its group yet.
            os.kill(client.data, signal.SIGKILL)
            with suppress(ProcessLookupError):
                os.killpg(client.data, signal.SIGKILL)

    def _end(self, ended: int, process: int, client: socket.socket) -> None:
        """Tell a client the exit code of its command."""
        _, status = os.waitpid(process, 0)
        self._waiting.unregister(ended)
        os.close(ended)
        if client.fileno() in self._waiting.get_map():
            self._waiting.unregister(client)
            with suppress(ConnectionError):
                client.send(str(os.waitstatus_to_exitcode(status)).encode())
        client.close()


def main(path: str) -> None:
    """Serve; execute ``revolve`` in each process of a command."""
    _import_all()
    gc.freeze()
    tasks = Path("/proc/self/task").glob("*/comm")
    names = {task.read_text().strip() for task in tasks}
    assert names <= {"python", _OF_ARROW}, names
    server = os.getpid()
    with socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET) as listener:
        listener.bind(path)
        listener.listen()
        sys.stdout.write("ready\n")
        sys.stdout.flush()
        _Server(listener).serve()
    if os.getpid() != server:
        runpy.run_module("revolve", run_name="__main__", alter_sys=True)


if __name__ == "__main__":
    main(sys.argv[1])
