"""The command ``revolve`` of tests, as a fork of a server that has all its modules.

A start takes 50 ms instead of half a second or, with figures, two seconds. Otherwise
the command is one of a new interpreter: a process that leads a session of its own. It
has the folder, environment and open files of the process that starts it. Its agents are
forks of a fork of it. On systems other than Linux it is a new interpreter.

As a program, this file sends its files to the server, waits for the command, and exits
with its code. If it is killed, so is the command. Other signals are sent to the command
itself: the program writes its process id to a file, if it is given one.
"""

import json
import os
import socket
import sys

MOST_BYTES = 1 << 18
"""Size of a request, whose largest part is the environment [bytes]."""


def command(teller: int | None = None) -> list[str]:
    """Return the words that start ``revolve``, before its arguments.

    ``teller``: open file to which the command's process id is written.
    """
    if sys.platform != "linux":
        return [sys.executable, "-m", "revolve"]
    from tests import command_server  # not for the program, which imports little

    told = "" if teller is None else str(teller)
    return [sys.executable, "-IS", __file__, command_server.address(), told]


def _ask(address: str, teller: str, words: list[str]) -> int:
    """Let the server execute a command with the files of this process."""
    folder = os.getcwd()  # noqa: PTH109 - pathlib would be half of the start
    request = json.dumps([words, folder, dict(os.environ)])
    with socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET) as server:
        server.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, MOST_BYTES)
        server.connect(address)
        socket.send_fds(server, [request.encode()], [0, 1, 2])
        process = server.recv(64)
        if teller:
            os.write(int(teller), process)
            os.close(int(teller))
        code = int(server.recv(64))
    if code < 0:
        os.kill(os.getpid(), -code)
    return code


if __name__ == "__main__":
    sys.exit(_ask(sys.argv[1], sys.argv[2], sys.argv[3:]))
