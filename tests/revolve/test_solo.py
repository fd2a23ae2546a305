"""Tasks of the process that simulates single robots, done in this process."""

from msgspec import msgpack

import revolve as rv
from revolve.evaluation import settings_for
from revolve.messages import Outcome
from revolve.robot import plain, task_of
from revolve.solo import outcome_of
from worker.robot.evaluation import evaluate

STRONG = """name = "strong"
[simulation]
torque_factor = 1e9
servo_stiffness = 1e9
window_steps = 400
"""
WEAK = """
[robust]
draws = 2
torque = [1e-9, 1e-9]
"""


def _outcome(robot: rv.Robot, *, is_judged: bool = True) -> Outcome:
    task = task_of(robot, settings_for(robot, None), is_judged=is_judged)
    return msgpack.decode(outcome_of(msgpack.encode(task)), type=Outcome)


def test_a_robust_evaluation_is_that_of_a_worker() -> None:
    """Also if physics diverges without disturbances, which have no part in it."""
    strong = rv.Experiment.from_toml(STRONG)
    weakened = rv.Experiment.from_toml(STRONG + WEAK)
    robots = [rv.Robot.random(weakened, seed=3, number=number) for number in range(6)]
    diverged = 0
    for robot in robots:
        found = _outcome(robot)
        settings = settings_for(robot, None)
        assert found.evaluation == evaluate(plain(robot), settings)
        assert found.failure == ""
        undisturbed = _outcome(rv.Robot(robot.parts, robot.brain, strong))
        assert found.trace == undisturbed.trace
        # Fails alike, whether its fitness is asked for or not.
        assert _outcome(robot, is_judged=False).trace == undisturbed.trace
        diverged += undisturbed.trace is None
        assert bool(undisturbed.failure) == (undisturbed.evaluation is None)
    assert diverged in range(1, 6)
