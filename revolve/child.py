"""Program of the processes that the Python API starts.

``python -m revolve.child FD simulate`` does tasks; ``... FD command WORDS`` runs a
command of ``revolve``. FD is a socket for messages. The process ends when its standard
input is closed, which happens at the latest with its parent.
"""

import os
import signal
import sys
from multiprocessing.connection import Connection

import msgspec

from revolve.command import main as run_command
from schema.agent.supervisor import prepare_process, stop_with_input

_SIMULATE = "simulate"


def main(words: list[str]) -> int:
    """Do what the words say (see above) and return the exit code."""
    connection = Connection(int(words[0]))
    if words[1] == _SIMULATE:
        stop_with_input(lambda: os._exit(0))
        return _serve(connection)
    stop_with_input(lambda: os.kill(os.getpid(), signal.SIGTERM))
    sys.argv[1:] = words[2:]
    return _run(connection)


def _run(connection: Connection) -> int:
    """Run the command of ``sys.argv``; send the error that it ends with."""
    is_told = False

    def tell(error: Exception) -> None:
        nonlocal is_told
        from revolve.messages import problem_of  # noqa: PLC0415 - imports NumPy

        is_told = True
        connection.send_bytes(msgspec.msgpack.encode(problem_of(error)))

    try:
        code = run_command(tell=tell)
    except SystemExit as end:
        # Of a parser, which has written what is wrong.
        code = end.code if isinstance(end.code, int) else 1
    from schema.agent.flags import Flags  # noqa: PLC0415 - as above
    from schema.errors import RevolveError  # noqa: PLC0415 - as above

    if Flags.last_error and not is_told:
        tell(RevolveError(Flags.last_error))
    return code


def _serve(connection: Connection) -> int:
    prepare_process()  # before NumPy is imported, as the command does
    from revolve.solo import outcome_of  # noqa: PLC0415
    from schema.agent.stopping import STOPPED  # noqa: PLC0415

    while True:
        try:
            task = connection.recv_bytes()
        except EOFError:
            return 0
        try:
            outcome = outcome_of(task)
        except KeyboardInterrupt:
            # Of a plug-in, or of a signal to this process; raised again by the caller.
            return STOPPED
        connection.send_bytes(outcome)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
