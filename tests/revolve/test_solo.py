"""Tasks of the process that simulates single robots, done in this process."""

from dataclasses import replace

import pytest
from msgspec import msgpack

import revolve as rv
from revolve.evaluation import settings_for
from revolve.messages import Outcome
from revolve.robot import plain, task_of
from revolve.solo import outcome_of
from schema.wire.messages import Failure, Traced
from worker.robot.evaluation import evaluate

PLAIN = """name = "plain"
[simulation]
window_steps = 400
"""
STRONG = f"{PLAIN}torque_factor = 1e9\nservo_stiffness = 1e9\n"
WEAK = """
[robust]
draws = 2
torque = [1e-9, 1e-9]
"""


def _traced(robot: rv.Robot, *, is_judged: bool = True) -> Traced:
    task = task_of(robot, settings_for(robot, None), is_judged=is_judged)
    outcome = msgpack.decode(outcome_of(msgpack.encode(task)), type=Outcome)
    assert outcome.traced is not None
    return outcome.traced


@pytest.mark.parametrize(("text", "diverges"), [(PLAIN, False), (STRONG, True)])
def test_a_robust_evaluation_is_that_of_a_worker(text: str, *, diverges: bool) -> None:
    """Also if physics diverges without disturbances, which have no part in it."""
    robot = rv.Robot.random(rv.Experiment.from_toml(text + WEAK), seed=3)
    found = _traced(robot)
    assert found.outcome == evaluate(plain(robot), settings_for(robot, None))
    alone = replace(robot, experiment=rv.Experiment.from_toml(text))
    undisturbed = _traced(alone)
    traces = [_traced(each, is_judged=False).trace for each in (robot, alone)]
    assert found.trace == undisturbed.trace == traces[0] == traces[1]
    assert (found.trace is None) == diverges
    assert isinstance(undisturbed.outcome, Failure) == diverges
