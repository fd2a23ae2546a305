"""Robots for the worker's tests: hand-made and random ones."""

from collections.abc import Callable

import numpy as np
import pytest

import worker.measures
from schema.experiment.document import Experiment, body_space
from schema.parts import BodySpace
from schema.plugins.needs import needs
from schema.robot.brain import INPUT, NEURON_TYPES, Brain, Connection, Neuron
from schema.robot.robot import Part, Robot, check_robot
from schema.robot.trace import COMPUTED, RECORDED, Trace
from tests.schema import robots

GREY = robots.GREY


def random_robot(seed: int, size: int = 12) -> Robot:
    """Return a planar robot of about ``size`` parts within the thesis's limits."""
    rng = np.random.default_rng(seed)
    space = body_space(Experiment(name="test").space)
    robot = Robot(())
    while not any(space[part.kind].motor for part in robot.parts):
        robot = Robot(_random_body(rng, size, space))
    robot = Robot(robot.parts, _random_brain(rng, robot, space))
    check_robot(robot, space)
    return robot


def _random_body(
    rng: np.random.Generator, size: int, space: BodySpace
) -> tuple[Part, ...]:
    """Return parts in depth-first order, with random numbers of children."""
    parts = [Part("Core", -1, -1, -1, 0, GREY)]
    motors = pads = 0

    def grow(parent: int, own: int, level: int) -> None:
        nonlocal motors, pads
        for slot in range(space[parts[parent].kind].arity):
            if slot == own or len(parts) >= size or rng.random() < 0.3:
                continue
            kinds = [k for k in space.values() if not k.is_root]
            kind = kinds[int(rng.integers(len(kinds)))]
            if motors + kind.outputs > 10 or pads + kind.inputs > 4:
                continue
            motors, pads = motors + kind.outputs, pads + kind.inputs
            turn = int(rng.integers(4)) * 90
            if kind.is_levelled:
                turn = -level % 360
            values = tuple(float(rng.uniform(p.low, p.high)) for p in kind.parameters)
            end = int(rng.integers(kind.arity))
            parts.append(Part(kind.name, parent, slot, end, turn, values))
            grow(len(parts) - 1, end, (level + turn) % 360)

    grow(0, -1, 0)
    return tuple(parts)


def _random_brain(rng: np.random.Generator, robot: Robot, space: BodySpace) -> Brain:
    def neuron(layer: str, part: int) -> Neuron:
        kind = list(NEURON_TYPES)[int(rng.integers(3))]
        values = tuple(float(rng.uniform(p.low, p.high)) for p in NEURON_TYPES[kind])
        return Neuron("output" if layer == "output" else "hidden", kind, part, values)

    parts = list(enumerate(robot.parts))
    inputs = [
        Neuron("input", INPUT, index)
        for index, part in parts
        for _ in range(space[part.kind].inputs)
    ]
    outputs = [neuron("output", i) for i, p in parts if space[p.kind].outputs]
    hidden = [
        neuron("hidden", part)
        for part in sorted(rng.integers(len(parts), size=int(rng.integers(11))))
    ]
    neurons = (*inputs, *outputs, *hidden)
    edges = tuple(
        Connection(source, target, float(rng.random()))
        for source in range(len(neurons))
        for target in range(len(inputs), len(neurons))
        if rng.random() < 0.2
    )
    return Brain(neurons, edges)


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
