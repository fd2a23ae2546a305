"""Program of the processes that the Python API starts.

``python -m revolve.child FD simulate`` does tasks; ``... FD command WORDS`` runs a
command of ``revolve``. FD is a socket for messages. The process ends when its standard
input is closed, which happens at the latest with its parent.
"""

import os
import signal
import sys
import threading
from collections.abc import Callable
from multiprocessing.connection import Connection

import msgspec

from revolve.command import main as run_command

_SIMULATE = "simulate"


def main(words: list[str]) -> int:
    """Do what the words say and return the exit code.

    Args:
        words: number of the socket, ``simulate`` or ``command``, words of the command.
    """
    connection = Connection(int(words[0]))
    if words[1] == _SIMULATE:
        _end_with_input(lambda: os._exit(0))
        return _serve(connection)
    _end_with_input(lambda: os.kill(os.getpid(), signal.SIGTERM))

    def tell(error: Exception) -> None:
        from revolve.messages import problem_of  # noqa: PLC0415 - imports NumPy

        connection.send_bytes(msgspec.msgpack.encode(problem_of(error)))

    sys.argv[1:] = words[2:]
    return run_command(tell=tell)


def _end_with_input(end: Callable[[], None]) -> None:
    """Call a function when standard input is closed."""

    def watch() -> None:
        while os.read(0, 1024):
            pass
        end()

    threading.Thread(target=watch, daemon=True).start()


def _serve(connection: Connection) -> int:
    """Do tasks one by one."""
    # Before NumPy is imported, as the command does.
    from schema.agent.supervisor import prepare_process  # noqa: PLC0415

    prepare_process()
    from revolve.solo import outcome_of  # noqa: PLC0415

    while True:
        try:
            task = connection.recv_bytes()
        except EOFError:
            return 0
        connection.send_bytes(outcome_of(task))


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
