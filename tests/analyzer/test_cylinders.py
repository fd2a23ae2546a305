"""Intersection of cylinders: worked by hand, and compared with MuJoCo's distances."""

import math
from collections.abc import Iterator

import mujoco
import numpy as np
import pytest

from analyzer.cylinders import PlacedSolid, least_separation
from analyzer.report import Boxes, bounding_box, intersecting_parts, place_boxes
from schema.experiment.document import Vetting
from schema.parts import BUILT_IN, IDENTITY, Matrix, PartType, Shape, Slot, cylinder
from schema.robogen_parts import ACTIVE_WHEEL, WHEEL
from schema.robot.robot import Part, Robot
from schema.robot.trace import Floats

OVERLAP = Vetting(mode="overlap", tolerance_m=1e-6)
CONTACT = Vetting(mode="contact", tolerance_m=1e-6)
GREY = (0.5, 0.5, 0.5)
ON_SIDE: Matrix = ((0.0, 0.0, 1.0), (0.0, 1.0, 0.0), (-1.0, 0.0, 0.0))
"""A quarter about y: the axis of a cylinder is along x."""


def bodies(
    rotation: list[Floats], centre: list[tuple[float, ...]], half: Floats, *, both: bool
) -> tuple[PlacedSolid, PlacedSolid]:
    """Return two bodies, a cylinder and a box or another cylinder."""
    places = [np.array(place, dtype=float) for place in centre]
    return (
        PlacedSolid(rotation[0], places[0], half[0], is_round=True),
        PlacedSolid(rotation[1], places[1], half[1], is_round=both),
    )


def turned(rng: np.random.Generator) -> Floats:
    """Return a random rotation."""
    quaternion = rng.normal(size=4)
    matrix = np.empty(9)
    mujoco.mju_quat2Mat(matrix, quaternion / np.linalg.norm(quaternion))
    return matrix.reshape(3, 3)


# --- by hand -----------------------------------------------------------------


def test_parallel_cylinders_are_apart_by_their_distance_less_the_radii() -> None:
    half = np.array([(0.3, 0.3, 1.0), (0.2, 0.2, 1.0)])
    for gap in (0.1, 0.0, -0.1):
        reach = (0.5 + gap) / math.sqrt(2)
        pair = bodies(
            [np.eye(3)] * 2, [(0, 0, 0), (reach, reach, 0.4)], half, both=True
        )
        assert least_separation(*pair) == pytest.approx(gap, abs=1e-9)


def test_a_cube_at_the_side_of_a_cylinder_is_met_at_its_edge() -> None:
    """Its edge is at the corner (0.6, 0.6) of the plane, the radius is 0.5."""
    half = np.array([(0.5, 0.5, 1.0), (0.4, 0.4, 0.4)])
    pair = bodies([np.eye(3)] * 2, [(0, 0, 0), (1.0, 1.0, 0)], half, both=False)
    expected = 0.6 * math.sqrt(2) - 0.5
    assert least_separation(*pair) == pytest.approx(expected, abs=1e-9)


def test_coins_on_edge_meet_at_a_rim() -> None:
    """A coin stands on its rim on the face of another one."""
    upright = np.array(ON_SIDE)
    half = np.array([(1.0, 1.0, 0.1), (0.5, 0.5, 0.05)])
    for gap in (0.02, -0.03):
        pair = bodies([np.eye(3), upright], [(0, 0, 0), (0, 0, 0.6 + gap)], half,
                      both=True)  # fmt: skip
        assert least_separation(*pair) == pytest.approx(gap, abs=1e-9)


def disc(radius: float, axis: Matrix, reach: float) -> PartType:
    """Return a type of one disc, 20 mm thick, whose slot is ``reach`` from its centre.

    Its axis is along the normal of the slot, or along the z axis of the core.
    """
    slot = Slot((-reach, 0.0, 0.0), (-1.0, 0.0, 0.0), (0.0, 0.0, 1.0))
    body = cylinder("disc", radius, 0.02, (0.0, 0.0, 0.0), 0.01, rotation=axis)
    shape = Shape((body,), (slot,))
    return PartType("Disc", 1, lambda _: shape)


def on_two_faces(kind: PartType) -> tuple[Robot, Boxes]:
    """Return a core with a part on each of two neighbouring faces."""
    parts = (
        Part("Core", -1, -1, -1, 0, GREY),
        Part("Disc", 0, 1, 0, 0, GREY),
        Part("Disc", 0, 2, 0, 0, GREY),
    )
    robot = Robot(parts)
    return robot, place_boxes(robot, {**BUILT_IN, "Disc": kind})


def test_hull_and_mass_of_a_disc() -> None:
    _, boxes = on_two_faces(disc(0.06, ON_SIDE, 0.01))
    assert bounding_box(boxes)[1] == pytest.approx((0.065, 0.065, 0.06))
    assert boxes.lower[2] == pytest.approx((0.045, -0.06, -0.06), abs=1e-12)
    assert boxes.mass == pytest.approx(0.11)
    assert boxes.round == (1, 2)


@pytest.mark.parametrize(
    ("radius", "overlap", "contact"),
    [(0.044, False, False), (0.045, False, True), (0.046, True, True)],
)
def test_wheels_on_neighbouring_faces_meet_at_the_core_s_edge(
    radius: float, *, overlap: bool, contact: bool
) -> None:
    """Their planes cross 45 mm from the axes, half of the core's width."""
    robot, boxes = on_two_faces(disc(radius, ON_SIDE, 0.01))
    assert bool(intersecting_parts(boxes, robot, OVERLAP)) is overlap
    assert bool(intersecting_parts(boxes, robot, CONTACT)) is contact


@pytest.mark.parametrize(
    ("radius", "meet"), [(0.06, ()), (0.108, ()), (0.11, ((1, 2),))]
)
def test_discs_beside_the_core_meet_later_than_their_boxes(
    radius: float, meet: tuple[tuple[int, int], ...]
) -> None:
    """Their axes are sqrt(2) (45 mm + radius) apart; their boxes meet from 45 mm on."""
    robot, boxes = on_two_faces(disc(radius, IDENTITY, radius))
    assert boxes.lower[1, 0] < boxes.upper[2, 0]
    assert intersecting_parts(boxes, robot, CONTACT) == meet


# --- oracle ------------------------------------------------------------------


def pairs(
    count: int, *, both: bool
) -> Iterator[tuple[tuple[PlacedSolid, PlacedSolid], float]]:
    """Yield random pairs of bodies and their distances as MuJoCo finds them."""
    spec = mujoco.MjSpec()
    kinds = ("CYLINDER", "CYLINDER" if both else "BOX")
    for kind in kinds:
        body = spec.worldbody.add_body(mocap=True)
        body.add_geom(type=getattr(mujoco.mjtGeom, f"mjGEOM_{kind}"), size=(1, 1, 1))
    spec.option.ccd_tolerance = 1e-9
    model = spec.compile()
    data = mujoco.MjData(model)
    rng = np.random.default_rng(7)
    for _ in range(count):
        turns = [turned(rng), turned(rng)]
        centre = [(0.0, 0.0, 0.0), tuple(rng.normal(scale=0.6, size=3).tolist())]
        half = rng.uniform(0.05, 0.6, (2, 3))
        for index in range(1 + both):
            half[index, 1] = half[index, 0]
        for index, turn in enumerate(turns):
            mujoco.mju_mat2Quat(data.mocap_quat[index], turn.ravel())
            data.mocap_pos[index] = centre[index]
            size = half[index] if kinds[index] == "BOX" else half[index][[0, 2, 1]]
            model.geom_size[index] = size
        mujoco.mj_kinematics(model, data)
        found = mujoco.mj_geomDistance(model, data, 0, 1, 10.0, None)
        yield bodies(turns, centre, half, both=both), float(found)


@pytest.mark.parametrize("both", [False, True])
def test_random_pairs_are_as_far_apart_as_in_mujoco(*, both: bool) -> None:
    apart = together = 0
    for pair, distance in pairs(200, both=both):
        found = least_separation(*pair)
        if distance > 1e-4:
            apart += 1
            assert 0.0 < found < distance + 1e-6
        elif distance < -1e-5:
            together += 1
            assert found < 0.0
    assert min(apart, together) > 40


@pytest.mark.parametrize("radius", [40.0, 60.0, 80.0])
def test_wheels_beside_a_robot_are_vetted_as_cylinders(radius: float) -> None:
    """Wheels at the end of bricks on opposite faces are far apart at any radius."""
    wheel = (radius, *GREY)
    parts = (
        Part("Core", -1, -1, -1, 0, GREY),
        Part("FixedBrick", 0, 2, 0, 0, GREY),
        Part("ActiveWheel", 1, 1, 0, 0, wheel),
        Part("ActiveWheel", 0, 3, 0, 0, wheel),
    )
    robot = Robot(parts)
    space = {**BUILT_IN, "ActiveWheel": ACTIVE_WHEEL, "Wheel": WHEEL}
    boxes = place_boxes(robot, space)
    assert boxes.mass == pytest.approx(0.09 + 0.0102 + 2 * 0.018)
    assert boxes.upper[:, 2].max() == pytest.approx(radius / 1000.0)
    assert intersecting_parts(boxes, robot, CONTACT) == ()
    # On the side of the brick, the driven wheel is 54.55 mm from the core's axis,
    # beyond the core's 45 mm; the passive one is 26.5 mm from it.
    for kind, meet in (("ActiveWheel", ()), ("Wheel", ((0, 2),))):
        beside = Robot((*parts[:2], Part(kind, 1, 2, 0, 0, wheel)))
        boxes = place_boxes(beside, space)
        assert intersecting_parts(boxes, beside, OVERLAP) == meet
