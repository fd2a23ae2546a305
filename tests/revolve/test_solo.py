"""Tasks of the process that simulates single robots, done in this process."""

from dataclasses import replace

import pytest
from msgspec import msgpack

import revolve as rv
from revolve.evaluation import settings_for
from revolve.messages import Outcome
from revolve.robot import plain, task_of
from revolve.solo import outcome_of
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


def _outcome(robot: rv.Robot, *, is_judged: bool = True) -> Outcome:
    task = task_of(robot, settings_for(robot, None), is_judged=is_judged)
    return msgpack.decode(outcome_of(msgpack.encode(task)), type=Outcome)


@pytest.mark.parametrize(("text", "diverges"), [(PLAIN, False), (STRONG, True)])
def test_a_robust_evaluation_is_that_of_a_worker(text: str, *, diverges: bool) -> None:
    """Also if physics diverges without disturbances, which have no part in it."""
    robot = rv.Robot.random(rv.Experiment.from_toml(text + WEAK), seed=3)
    found = _outcome(robot)
    assert found.evaluation == evaluate(plain(robot), settings_for(robot, None))
    assert found.failure == ""
    alone = replace(robot, experiment=rv.Experiment.from_toml(text))
    undisturbed = _outcome(alone)
    traces = [_outcome(each, is_judged=False).trace for each in (robot, alone)]
    assert found.trace == undisturbed.trace == traces[0] == traces[1]
    assert (found.trace is None) == diverges
    assert bool(undisturbed.failure) == (undisturbed.evaluation is None) == diverges
