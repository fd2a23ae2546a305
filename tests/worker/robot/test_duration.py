"""Evaluations with a duration in the request; the window is the same."""

import math
from itertools import pairwise

import pytest
from msgspec.structs import replace

from schema.errors import ExperimentError
from schema.experiment.document import Experiment, Simulation
from schema.experiment.settings import evaluation_settings, evaluation_settings_of
from schema.robot.ids import NOBODY
from schema.robot.results import Evaluation
from schema.robot.robot import Robot
from schema.wire.messages import Evaluate, Request
from worker.robot.evaluation import simulate
from worker.serve.jobs import answer_evaluation

WORLD = Simulation(window_steps=400, pose_steps=40, warmup_steps=80)
EXPERIMENT = Experiment(name="test", simulation=WORLD)


def evaluated(robot: Robot, steps: int = 0) -> Evaluation:
    work = Evaluate(NOBODY, robot, steps=steps)
    request = Request("run", 3, 17, work, evaluation_settings(EXPERIMENT))
    result = answer_evaluation(request, work)
    assert isinstance(result, Evaluation)
    return result


def test_zero_steps_use_the_warm_up_of_the_settings(turtle: Robot) -> None:
    assert evaluated(turtle).simulated_s == pytest.approx(2.4)
    assert evaluated(turtle) == evaluated(turtle, steps=480)


def test_longer_evaluation_is_judged_by_its_last_window(turtle: Robot) -> None:
    found = evaluated(turtle, steps=1200)
    assert found.simulated_s == pytest.approx(6.0)
    # All 6 s as one window, of which the last 2 s are the last 11 of 31 samples.
    whole = replace(WORLD, warmup_steps=0, window_steps=1200)
    settings = replace(evaluation_settings_of(EXPERIMENT), simulation=whole)
    track = simulate(turtle, settings).core_position[-11:]
    hops = [math.dist(a[:2], b[:2]) for a, b in pairwise(track)]
    assert found.path_velocity == pytest.approx(sum(hops) / 2.0, rel=1e-12)
    net = math.dist(track[0][:2], track[-1][:2])
    assert found.straight_velocity == pytest.approx(net / 2.0, rel=1e-12)
    assert found.path_velocity != evaluated(turtle).path_velocity


def test_duration_need_not_be_a_multiple_of_the_pose_interval(turtle: Robot) -> None:
    assert evaluated(turtle, steps=401).simulated_s == pytest.approx(2.005)


def test_duration_shorter_than_the_window_is_rejected(turtle: Robot) -> None:
    with pytest.raises(ExperimentError, match="400 steps, got 399"):
        evaluated(turtle, steps=399)
