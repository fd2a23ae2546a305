"""Workers that do not simulate, for benchmarks of dispatch, network and tables.

Every robot has fitness 0, at once or after a fixed time of sleep.
"""

import time

from schema.agent.network import Agent
from schema.agent.service import serve_as_process
from schema.agent.supervision import ProcessSlot
from schema.experiment.settings import read_evaluation_settings
from schema.robot.results import Evaluation
from schema.wire import revolve_pb2 as pb
from schema.wire.codec import Answer, encode_answer

TIMED_S = 0.04
"""Duration of an evaluation by ``timed_process`` [s]."""


def answer(request: bytes) -> bytes:
    """Return the encoded answer to an encoded evaluation request: fitness 0.

    The robot is not decoded, as decoding is part of an evaluation.
    """
    job = pb.Request.FromString(request)
    clock = read_evaluation_settings(job.settings).simulation
    steps = job.steps or clock.evaluation_steps
    nothing = Evaluation(0.0, 0.0, 0.0, steps * clock.timestep_s)
    return encode_answer(Answer(job.epoch, job.number, 0.0, nothing))


def process(agent: Agent, slot: ProcessSlot) -> None:
    """Run one process that answers at once; returns when asked to stop."""
    serve_as_process(answer, agent, slot)


def timed_process(agent: Agent, slot: ProcessSlot) -> None:
    """Run one process that answers after ``TIMED_S``; returns when asked to stop."""

    def slow_answer(request: bytes) -> bytes:
        until_s = time.monotonic() + TIMED_S
        answered = answer(request)
        time.sleep(max(0.0, until_s - time.monotonic()))
        return answered

    serve_as_process(slow_answer, agent, slot)
