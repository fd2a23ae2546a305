"""Benchmark of the overhead of an evaluation over its physics."""

import pytest

from analyzer.report import analyze
from coordinator.evolution.generation import generate
from schema.experiment.document import Experiment
from schema.experiment.settings import EvaluationSettings
from worker.bench.arena_bench import RobotSource
from worker.bench.command import LEAST_RATIO, Timing, time_evaluations

EXPERIMENT = Experiment(name="test")
SETTINGS = EvaluationSettings(
    space=EXPERIMENT.space, simulation=EXPERIMENT.simulation, fitness=EXPERIMENT.fitness
)


@pytest.mark.benchmark
@pytest.mark.slow
def test_engine_steps_are_most_of_the_time_of_an_evaluation() -> None:
    robots = RobotSource(generate, analyze).robots(
        EXPERIMENT, 30, seed=1, is_vetted=False
    )
    timing = time_evaluations(robots, SETTINGS)
    assert timing.ratio >= LEAST_RATIO, timing


def test_ratio_is_engine_time_over_evaluation_time() -> None:
    assert Timing(robots=2, evaluation_s=4.0, engine_s=3.0).ratio == 0.75
