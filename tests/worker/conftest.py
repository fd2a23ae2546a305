"""Robots for the worker's tests: hand-made and random ones."""

from collections.abc import Callable

import numpy as np
import pytest

import worker.measures
from coordinator.evolution.generation import generate
from schema.experiment.document import Experiment, body_space
from schema.robot.brain import Brain, Neuron
from schema.robot.genome import develop
from schema.robot.robot import Part, Robot
from schema.robot.trace import COMPUTED, RECORDED, Trace, needs
from tests.schema import robots

GREY = robots.GREY


def random_robot(seed: int) -> Robot:
    """Return a random robot within the thesis's limits; its parts may intersect."""
    experiment = Experiment(name="test")
    genome = generate(np.random.default_rng(seed), experiment)
    return develop(genome, body_space(experiment.space))


@pytest.fixture
def traces(monkeypatch: pytest.MonkeyPatch) -> list[Trace]:
    """Return the traces that the measure ``keep`` gets, which needs all channels."""
    kept: list[Trace] = []

    @needs(*RECORDED, *COMPUTED)
    def keep(trace: Trace) -> float:
        kept.append(trace)
        return 1.0

    monkeypatch.setitem(worker.measures.BUILT_IN, "keep", keep)
    worker.measures.measures_of.cache_clear()
    worker.measures.functions_of.cache_clear()
    return kept


@pytest.fixture(scope="session")
def robot_of() -> Callable[[int], Robot]:
    """Return a function seed -> random planar robot."""
    return random_robot


@pytest.fixture(scope="session")
def turtle() -> Robot:
    """Return a core with two hinged bricks beside it, driven by oscillators."""
    turtle = robots.robot_of(
        Part("ActiveHinge", 0, 2, 0, 0, GREY),
        Part("FixedBrick", 1, 1, 0, 0, GREY),
        Part("ActiveHinge", 0, 3, 1, 90, GREY),
        Part("FixedBrick", 3, 0, 2, 270, GREY),
        Part("TouchSensor", 4, 0, 0, 0, GREY),
    )
    neurons = (
        *turtle.brain.neurons[:8],
        Neuron("output", "Oscillator", 1, (1.5, 0.0, 1.0)),
        Neuron("output", "Oscillator", 3, (1.5, 0.25, 1.0)),
    )
    return Robot(turtle.parts, Brain(neurons))
