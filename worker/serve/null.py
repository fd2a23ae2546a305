"""Workers that do not simulate: what everything else costs.

Every robot is judged 0, at once or after a time in which the processor is free. For
benchmarks of dispatch, network and tables.
"""

import time

from schema.agent.network import Agent
from schema.agent.service import serve_as_process
from schema.agent.supervision import ProcessSlot
from schema.robot.results import Evaluation
from schema.wire import revolve_pb2 as pb
from schema.wire.codec import Answer, encode_answer

TIMED_S = 0.04
"""How long ``timed_process`` takes for an evaluation [s]."""


def answer(request: bytes) -> bytes:
    """Return the encoded answer to an encoded evaluation request: fitness 0.

    The robot stays encoded: to unpack it is part of an evaluation.
    """
    job = pb.Request.FromString(request)
    nothing = Evaluation(0.0, 0.0, 0.0, 0.0)
    return encode_answer(Answer(job.epoch, job.number, 0.0, nothing))


def process(agent: Agent, slot: ProcessSlot) -> None:
    """Be one process of a crew of such workers; returns when asked to end."""
    serve_as_process(answer, agent, slot)


def timed_process(agent: Agent, slot: ProcessSlot) -> None:
    """Be one that takes its time; returns when asked to end."""

    def slow_answer(request: bytes) -> bytes:
        until_s = time.monotonic() + TIMED_S
        answered = answer(request)
        time.sleep(max(0.0, until_s - time.monotonic()))
        return answered

    serve_as_process(slow_answer, agent, slot)
