"""Benchmark of a stepped simulation against an evaluation, in one process."""

import time
from collections.abc import Callable

import pytest

import revolve as rv
from revolve.evaluation import settings_for
from revolve.robot import plain
from worker.robot.evaluation import evaluate

MOST_RATIO = 1.15
_ROBOTS, _TURNS = 12, 4


def _stepped(robot: rv.Robot) -> None:
    with rv.Simulation(robot, "scenario1") as simulation:
        while not simulation.done:
            simulation.observe()
            simulation.step()


def _evaluated(robot: rv.Robot) -> None:
    evaluate(plain(robot), settings_for(robot, "scenario1"))


def _took_s(function: Callable[[rv.Robot], None], robot: rv.Robot) -> float:
    start = time.thread_time()
    function(robot)
    return time.thread_time() - start


@pytest.mark.benchmark
@pytest.mark.slow
def test_stepping_costs_little_more_than_an_evaluation() -> None:
    robots = [rv.Robot.random(seed=1, number=number) for number in range(_ROBOTS)]
    sums = {_stepped: 0.0, _evaluated: 0.0}
    for robot in robots:
        # In turns, as other load changes, and the least, as it only adds time.
        least = dict.fromkeys(sums, float("inf"))
        for _ in range(_TURNS):
            for function in sums:
                least[function] = min(least[function], _took_s(function, robot))
        for function in sums:
            sums[function] += least[function]
    ratio = sums[_stepped] / sums[_evaluated]
    print(f"stepping takes {ratio:.3f} of the time of an evaluation")
    assert ratio <= MOST_RATIO
