"""Descriptors: bodies on a grid against ARIEL's values, and gaits by hand."""

from typing import Any

import numpy as np
import pytest

from schema.robot.brain import Brain, Neuron
from schema.robot.robot import Part, Robot
from schema.robot.trace import Trace
from worker.descriptors import PART_M
from worker.measures import BUILT_IN

Place = tuple[float, float, float]
NAMES = ("proportion", "coverage", "limbs", "joints")


def trace(count: int, **channels: Any) -> Trace:  # noqa: ANN401
    return Trace(0.2, np.zeros((count, 3)), channels)


def body(parents: list[int], motors: list[int], places: list[Place]) -> Trace:
    """Return a trace of a body: parents by part, parts with motors, places [bricks]."""
    parts = tuple(Part("X", parent, 0, 0, 0, ()) for parent in parents)
    neurons = tuple(Neuron("output", "sigmoid", part) for part in motors)
    robot = Robot(parts, Brain(neurons))
    return trace(2, robot=robot, part_position=PART_M * np.array(places, float))


def line(count: int, step: Place) -> list[Place]:
    return [tuple((at + 1) * np.array(step)) for at in range(count)]


CENTRE: Place = (0, 0, 0)
SNAKE = body([-1, 0, 1, 2, 3], [1, 3], [CENTRE, *line(4, (1, 0, 0))])
SPIDER = body(
    [-1, 0, 1, 0, 3, 0, 5, 0, 7],
    [1, 3, 5, 7],
    [CENTRE, *line(2, (1, 0, 0)), *line(2, (-1, 0, 0)),
     *line(2, (0, 1, 0)), *line(2, (0, -1, 0))],
)  # fmt: skip
FORK = body(
    [-1, 0, 1, 2, 2, 2], [1, 3], [CENTRE, *line(3, (1, 0, 0)), (2, 1, 0), (2, -1, 0)]
)
CORE = body([-1], [], [CENTRE])


@pytest.mark.parametrize(
    ("robot", "values"),
    [
        # By ARIEL's MorphologicalMeasures (P, C, L, J), of July 2026.
        (CORE, (1, 1, 0, 0)),
        (SNAKE, (0.2, 1, 0.25, 0.5)),
        (SPIDER, (1, 0.36, 2 / 3, 0.5)),
        (FORK, (0.75, 0.5, 0.75, 0.4)),
    ],
)
def test_bodies_on_a_grid_have_the_values_of_ariel(
    robot: Trace, values: tuple[float, ...]
) -> None:
    found = [BUILT_IN[f"body_{name}"](robot) for name in NAMES]
    assert found == pytest.approx(values)


def test_size_and_height() -> None:
    assert BUILT_IN["body_size"](SPIDER) == 9
    # A tower of three: 3 of 3 cubes; with an arm 4 of 2 x 3; parts half as far: 1.
    tower = body([-1, 0, 1], [], [CENTRE, *line(2, (0, 0, 1))])
    arm = body([-1, 0, 1, 0], [], [CENTRE, *line(2, (0, 0, 1)), (1, 0, 0)])
    dense = body([-1, 0, 1], [], [CENTRE, *line(2, (0.5, 0, 0))])
    assert [BUILT_IN["body_coverage"](one) for one in (tower, arm, dense)] == (
        pytest.approx([1, 4 / 6, 1])
    )
    assert BUILT_IN["body_proportion"](tower) == 1


@pytest.mark.parametrize(
    ("contact", "share"),
    [
        # One part always, one half of the time, one never.
        ([(1, 0, 0), (1, 1, 0)], 0.75),
        ([(0, 0, 0), (0, 0, 0)], 0.0),
    ],
)
def test_duty_factor_counts_feet(contact: list[Any], share: float) -> None:
    assert BUILT_IN["duty_factor"](trace(2, contact=np.array(contact, bool))) == share


def test_periodicity_of_known_motions() -> None:
    """61 samples, 0.2 s apart."""
    time_s = 0.2 * np.arange(61)
    wave = np.sin(2 * np.pi * time_s / 1.6)
    noise = np.random.default_rng(0).normal(size=(61, 2))

    def found(*joints: Any) -> float:  # noqa: ANN401
        return BUILT_IN["periodicity"](trace(61, joint_angle=np.stack(joints, axis=1)))

    assert found(wave, 0.2 * wave**2) == pytest.approx(1, abs=1e-3)
    # Waves of 1.6 s and 2 s: the best lag is 1.8 s, with cosines of 0.707 and 0.809.
    both = found(wave, np.sin(np.pi * time_s))
    assert both == pytest.approx((0.707 + 0.809) / 2, abs=0.02)
    assert found(*noise.T) < 0.4
    assert found(0.1 * time_s) == 0  # turns on
    assert found(1e-5 * wave) == 0
    assert BUILT_IN["periodicity"](trace(61, joint_angle=np.zeros((61, 0)))) == 0
