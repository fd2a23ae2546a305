"""Plans of robots: outlines by hand."""

import numpy as np
import pytest

from analysis.render.plan import CORE, JOINT, MOTOR, RIGID, plan
from schema.parts import BUILT_IN
from schema.robot.robot import Part
from tests.schema.robots import GREY, robot_of

BRICK = Part("FixedBrick", 0, 2, 3, 0, GREY)


def test_a_brick_lies_beside_the_core() -> None:
    """The core reaches 45 mm from its centre, a brick 41 mm further; 25 cm are 1."""
    core, brick = plan(robot_of(BRICK), BUILT_IN)[::-1]
    middle = 0.5 * (0.086 - 0.045)
    assert {each.colour for each in (core, brick)} == {CORE, RIGID}
    for outline, ends in ((core, (-0.045, 0.045)), (brick, (0.045, 0.086))):
        x, y = outline.corners.T
        found = (x.min(), x.max(), y.min(), y.max())
        half = 0.5 * (ends[1] - ends[0])
        wanted = [ends[0] - middle, ends[1] - middle, -half, half]
        assert found == pytest.approx(np.array(wanted) / 0.25)


def test_large_robots_fill_the_square() -> None:
    arm = [Part("ActiveHinge", 0, 2, 0, 0, GREY)]
    arm += [Part("Hinge", at, 1, 0, 0, GREY) for at in range(1, 8)]
    outlines = plan(robot_of(*arm), BUILT_IN)
    assert {each.colour for each in outlines} == {CORE, MOTOR, JOINT}
    every = np.concatenate([each.corners for each in outlines])
    assert np.abs(every[:, 0]).max() == pytest.approx(0.5)
    assert every[:, 0].min() == pytest.approx(-0.5)
    assert np.abs(every[:, 1]).max() < 0.2
