"""Workers that do not simulate, for benchmarks of dispatch, network and tables.

Every robot has fitness 0, at once or after a fixed time of sleep.
"""

import time

from schema.agent.network import Agent
from schema.agent.service import serve_as_process
from schema.agent.supervision import ProcessSlot
from schema.experiment.settings import read_evaluation_settings
from schema.robot.results import Evaluation
from schema.wire.messages import Evaluate, Request

TIMED_S = 0.04
"""Duration of an evaluation by ``timed_process`` [s]."""


def answer(request: Request) -> Evaluation:
    """Return fitness 0 for the robot of an evaluation."""
    assert isinstance(request.work, Evaluate)
    clock = read_evaluation_settings(request.settings).simulation
    steps = request.work.steps or clock.evaluation_steps
    return Evaluation(0.0, 0.0, 0.0, steps * clock.timestep_s)


def process(agent: Agent, slot: ProcessSlot) -> None:
    """Run one process that answers at once; returns when asked to stop."""
    serve_as_process(answer, agent, slot)


def timed_process(agent: Agent, slot: ProcessSlot) -> None:
    """Run one process that answers after ``TIMED_S``; returns when asked to stop."""

    def slow_answer(request: Request) -> Evaluation:
        until_s = time.monotonic() + TIMED_S
        answered = answer(request)
        time.sleep(max(0.0, until_s - time.monotonic()))
        return answered

    serve_as_process(slow_answer, agent, slot)
