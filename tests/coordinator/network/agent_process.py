"""Agent process with a made-up answer, for tests of the network.

Arguments: the agent's role, name and hub, and its behaviour. ``good`` answers;
``stuck`` prints a line and never answers; ``slow`` prints a line and answers when told
to; ``long`` is like it, and its jobs count as long; ``busy`` computes for ever;
``old`` has another version.
"""

import sys
import threading

from schema.agent import request_handler
from schema.agent.machine import wire_version
from schema.agent.network import Agent
from schema.agent.service import serve
from schema.agent.supervisor import stop_on_signals
from schema.agent.topics import Role
from schema.errors import MalformedMessage
from schema.robot.results import Evaluation
from schema.wire.messages import Request


def answer(asked: Request) -> Evaluation:
    """Answer with the job's own number as fitness."""
    if asked.settings == b"bad":
        raise MalformedMessage("settings: bad")
    if asked.settings == b"bug":
        raise ZeroDivisionError("a plug-in's own")
    if BEHAVIOUR in {"stuck", "slow", "long", "busy"}:
        sys.stdout.write("begun\n")
        sys.stdout.flush()
    if BEHAVIOUR in {"slow", "long"}:
        sys.stdin.readline()
    if BEHAVIOUR == "stuck":
        threading.Event().wait()
    while BEHAVIOUR == "busy":
        pass
    return Evaluation(float(asked.number), 0.0, 0.0, 1.0)


def main(role: Role, name: str, address: str) -> None:
    """Serve until SIGTERM."""
    if BEHAVIOUR == "long":
        request_handler.LONG_S = 0.0
    version = "another" if BEHAVIOUR == "old" else wire_version()
    serve(
        answer,
        Agent(role, name, address, platform="p", version=version),
        stop_on_signals(),
    )


if __name__ == "__main__":
    BEHAVIOUR = sys.argv[4]
    assert sys.argv[1] in {"worker", "analyzer"}
    main("worker" if sys.argv[1] == "worker" else "analyzer", *sys.argv[2:4])
