"""Reports on bodies of known size, mass and viability."""

import pytest

from analyzer.report import analyze
from schema.experiment.document import Vetting
from schema.parts import BUILT_IN
from schema.robot.robot import Part, Robot

GREY = (0.5, 0.5, 0.5)
CORE = Part("Core", -1, -1, -1, 0, GREY)


def test_the_core_alone() -> None:
    report = analyze(Robot((CORE,)), BUILT_IN, Vetting())
    assert report.lower == (-0.045, -0.045, -0.0225)
    assert report.upper == (0.045, 0.045, 0.0225)
    assert report.mass == 0.09
    assert report.motors == 0
    assert not report.is_viable
    assert report.reason == "no part has a motor"


@pytest.mark.parametrize(
    ("slot", "lower", "upper"),
    [
        (0, (-0.045, -0.0827, -0.0225), (0.045, 0.045, 0.0225)),
        (1, (-0.045, -0.045, -0.0225), (0.045, 0.0827, 0.0225)),
        (2, (-0.045, -0.045, -0.0225), (0.0827, 0.045, 0.0225)),
        (3, (-0.0827, -0.045, -0.0225), (0.045, 0.045, 0.0225)),
    ],
)
def test_a_hinge_adds_its_length_on_its_side(
    slot: int, lower: tuple[float, ...], upper: tuple[float, ...]
) -> None:
    # Slot to slot an active hinge measures 37.7 mm.
    robot = Robot((CORE, Part("ActiveHinge", 0, slot, 0, 0, GREY)))
    report = analyze(robot, BUILT_IN, Vetting())
    assert report.lower == pytest.approx(lower, abs=1e-12)
    assert report.upper == pytest.approx(upper, abs=1e-12)
    assert report.mass == pytest.approx(0.1142, abs=1e-12)
    assert report.motors == 1
    assert report.is_viable
    assert report.reason == ""


def test_an_upright_bar_is_as_high_as_its_plate() -> None:
    # Turned by 90 degrees the bar tilts in the plane; by 0 out of it.
    flat = (100.0, 0.5, 0.0, *GREY)
    robot = Robot((CORE, Part("ParametricBarJoint", 0, 2, 0, 0, flat)))
    report = analyze(robot, BUILT_IN, Vetting())
    assert report.upper[2] == pytest.approx(0.0225, abs=1e-12)
    assert report.mass == pytest.approx(0.09 + 0.002 + 0.002, abs=1e-12)


def ring(count: int) -> Robot:
    """Return a hinge and a chain of bricks that turns right at every brick."""
    parts = [CORE, Part("ActiveHinge", 0, 0, 0, 0, GREY)]
    parts.append(Part("FixedBrick", 0, 1, 0, 0, GREY))
    parts += [Part("FixedBrick", index, 2, 0, 0, GREY) for index in range(2, count)]
    return Robot(tuple(parts))


@pytest.mark.parametrize(
    ("count", "pairs", "ending"),
    [
        (4, ((0, 4),), ""),
        (5, ((0, 4), (0, 5)), ", and 1 more pair"),
        # The fourth brick after the first stands where that one does.
        (6, ((0, 4), (0, 5), (2, 6)), ", and 2 more pairs"),
    ],
)
def test_the_reason_names_the_intersecting_parts(
    count: int, pairs: tuple[tuple[int, int], ...], ending: str
) -> None:
    report = analyze(ring(count), BUILT_IN, Vetting())
    assert not report.is_viable
    assert report.intersections == pairs
    assert report.reason == (f"parts 0 (Core) and 4 (FixedBrick) intersect{ending}")


def test_contact_is_allowed_in_overlap_mode() -> None:
    parts = (
        CORE,
        Part("ActiveHinge", 0, 0, 0, 0, GREY),
        Part("FixedBrick", 0, 1, 0, 0, GREY),
        Part("FixedBrick", 2, 1, 0, 0, GREY),
        Part("FixedBrick", 2, 2, 0, 0, GREY),
    )
    assert analyze(Robot(parts), BUILT_IN, Vetting(mode="overlap")).is_viable
    strict = analyze(Robot(parts), BUILT_IN, Vetting(mode="contact"))
    assert strict.intersections == ((0, 4), (3, 4))
    assert strict.reason == (
        "parts 0 (Core) and 4 (FixedBrick) intersect, and 1 more pair"
    )
