"""The generator against an independent Monte Carlo of 12000 robots of the original.

The oracle was written separately, with other geometry code, and shares no line with
this generator. Each of its figures must come out within 2 %, plus half of the last
digit in which it is published where it is a mean.
"""

import numpy as np
import pytest

from analyzer.report import analyze
from coordinator.evolution.generation import generate
from coordinator.evolution.random_streams import Purpose, stream
from schema.experiment.document import Experiment, Vetting, body_space
from schema.robot.genome import develop
from schema.robot.ids import BirthId
from schema.robot.robot import Robot

ROBOTS = 10_000
COLUMNS = ("parts", "motors", "hinges", "touch sensors", "extremities")
BEFORE = ("12.3", "2.74", "2.49", "1.52", "5.2")
AFTER = ("11.2", "2.62", "2.35", "1.45", "4.7")


def counts(robot: Robot) -> list[int]:
    kinds = [part.kind for part in robot.parts]
    parents = {part.parent for part in robot.parts}
    leaves = sum(index not in parents for index in range(len(kinds)))
    named = [kinds.count(kind) for kind in ("ActiveHinge", "Hinge", "TouchSensor")]
    return [len(kinds), *named, leaves]


def assert_near(found: float, published: str, what: str) -> None:
    figure = float(published)
    half_a_digit = 0.5 * 10.0 ** -len(published.partition(".")[2])
    allowed = 0.02 * figure + half_a_digit
    assert abs(found - figure) <= allowed, f"{what}: {found:.4f}, not {published}"


@pytest.mark.slow
def test_random_robots_match_the_independent_oracle() -> None:
    experiment = Experiment(name="oracle")
    space = body_space(experiment.space)
    tables = np.zeros((ROBOTS, len(COLUMNS)))
    is_viable = np.zeros((ROBOTS, 2))
    for number in range(ROBOTS):
        birth = BirthId(0, number)
        rng = stream(1, 0, birth, 0, Purpose.GENERATE)
        robot = develop(generate(rng, experiment, birth), space)
        tables[number] = counts(robot)
        is_viable[number] = (
            analyze(robot, space, Vetting(tolerance_m=1e-6)).is_viable,
            analyze(robot, space, Vetting(mode="contact")).is_viable,
        )
    touching, strict = is_viable.mean(axis=0)
    # Fractions: 2 % alone.
    assert touching == pytest.approx(0.72, rel=0.02)
    assert strict == pytest.approx(0.62, rel=0.02)
    before, after = tables.mean(axis=0), tables[is_viable[:, 0] > 0].mean(axis=0)
    for found, published in ((before, BEFORE), (after, AFTER)):
        for value, figure, name in zip(found, published, COLUMNS, strict=True):
            assert_near(value, figure, name)
