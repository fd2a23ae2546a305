"""Tests of box models: MuJoCo has the same boxes in every pose."""

import itertools

import mujoco
import numpy as np
import pytest

from analysis.viewer.body import box_model, neutral_pose, place, place_rows
from schema.errors import MalformedMessage
from schema.experiment.document import Simulation
from schema.mjcf.model import robot_spec
from schema.parts import (
    BUILT_IN,
    Box,
    Joint,
    Matrix,
    PartType,
    Shape,
    Slot,
    cylinder,
)
from schema.robogen_parts import ACTIVE_WHEEL
from schema.robot.brain import Brain
from schema.robot.ids import BirthId
from schema.robot.results import Floats
from schema.robot.robot import Part, Robot
from schema.tables.received import read_columns
from tests.coordinator.arena_world import poses

GREY = (0.2, 0.4, 0.6)
ROBOT = Robot(
    (
        Part("Core", -1, -1, -1, 0, GREY),
        Part("ActiveHinge", 0, 0, 0, 90, GREY),
        Part("FixedBrick", 1, 1, 0, 90, GREY),
        Part("Hinge", 2, 1, 1, 0, GREY),
        Part("ParametricBarJoint", 0, 2, 0, 0, (60.0, 0.7, 0.0, 1.0, 0.0, 0.5)),
        Part("ActiveHinge", 4, 1, 1, 270, GREY),
        Part("TouchSensor", 5, 0, 0, 180, GREY),
    ),
    Brain(),
)


def _oracle(root: Floats, angles: Floats) -> list[tuple[Floats, Floats]]:
    """Return centre and set of corners of each geom, from MuJoCo."""
    model = robot_spec(ROBOT, BUILT_IN, Simulation()).spec.compile()
    data = mujoco.MjData(model)
    data.qpos[:7], data.qpos[7:] = root, angles
    mujoco.mj_kinematics(model, data)
    return [
        (data.geom_xpos[geom], _corners(data, model, geom))
        for geom in range(model.ngeom)
    ]


def _corners(data: mujoco.MjData, model: mujoco.MjModel, geom: int) -> Floats:
    signs = np.array(list(itertools.product((-1, 1), repeat=3)))
    turned = data.geom_xmat[geom].reshape(3, 3)
    return np.asarray(data.geom_xpos[geom] + (signs * model.geom_size[geom]) @ turned.T)


def _own_corners(centre: Floats, attitude: Floats, half: Floats) -> Floats:
    signs = np.array(list(itertools.product((-1, 1), repeat=3)))
    matrix = np.zeros(9)
    mujoco.mju_quat2Mat(matrix, attitude[[3, 0, 1, 2]].astype(np.float64))
    return np.asarray(centre + (signs * half) @ matrix.reshape(3, 3).T)


@pytest.mark.parametrize("seed", range(4))
def test_boxes_are_where_the_engine_has_them(seed: int) -> None:
    rng = np.random.default_rng(seed)
    root = rng.normal(size=7)
    root[3:] /= np.linalg.norm(root[3:])
    angles = rng.uniform(-0.7, 0.7, 3)
    drawn = box_model(ROBOT, BUILT_IN, is_plain=False)
    centres, attitudes = place(drawn, root[None], angles[None])
    found = [
        _own_corners(centre, attitude, half)
        for centre, attitude, half in zip(
            centres[0], attitudes[0], drawn.half_sizes, strict=True
        )
    ]
    expected = [corners for _, corners in _oracle(root, angles)]
    assert len(found) == len(expected)
    for corners in expected:
        nearest = min(found, key=lambda own: _apart(own, corners))
        assert _apart(nearest, corners) < 1e-5


SLIDING: Matrix = ((0.0, 0.0, 1.0), (0.0, 1.0, 0.0), (-1.0, 0.0, 0.0))
_SLIDE = Shape(
    boxes=(
        Box("rail", (0.02, 0.02, 0.02), (0.01, 0.0, 0.0), 0.02),
        cylinder("rod", 0.005, 0.04, (0.04, 0.0, 0.0), 0.01, segment=1,
                 rotation=SLIDING),
    ),
    slots=(
        Slot((0.0, 0.0, 0.0), (-1.0, 0.0, 0.0), (0.0, 0.0, 1.0)),
        Slot((0.06, 0.0, 0.0), (1.0, 0.0, 0.0), (0.0, 0.0, 1.0), 1),
    ),
    joint=Joint((0.03, 0.0, 0.0), (1.0, 0.0, 0.0), 0.015, "prismatic"),
)  # fmt: skip
SPACE = {
    **BUILT_IN,
    "ActiveWheel": ACTIVE_WHEEL,
    "Slide": PartType("Slide", 2, lambda _: _SLIDE),
}
WHEELED = Robot(
    (
        Part("Core", -1, -1, -1, 0, GREY),
        Part("Slide", 0, 0, 0, 90, GREY),
        Part("ActiveHinge", 1, 1, 0, 0, GREY),
        Part("Slide", 2, 1, 1, 0, GREY),
        Part("ActiveWheel", 3, 0, 0, 90, (50.0, *GREY)),
    )
)


@pytest.mark.parametrize("seed", range(3))
def test_sliders_and_cylinders_are_where_the_engine_has_them(seed: int) -> None:
    """Boxes of a cylinder are centred in it; their corners are on its rims."""
    rng = np.random.default_rng(seed)
    root = rng.normal(size=7)
    root[3:] /= np.linalg.norm(root[3:])
    angles = np.array([0.01, 0.6, -0.015, 40.0]) * rng.uniform(-1.0, 1.0, 4)
    model = robot_spec(WHEELED, SPACE, Simulation()).spec.compile()
    data = mujoco.MjData(model)
    data.qpos[:7], data.qpos[7:] = root, angles
    mujoco.mj_kinematics(model, data)
    drawn = box_model(WHEELED, SPACE, is_plain=False)
    centres, attitudes = place(drawn, root[None], angles[None])
    corners = np.array(
        [
            _own_corners(centre, attitude, half)
            for centre, attitude, half in zip(
                centres[0], attitudes[0], drawn.half_sizes, strict=True
            )
        ]
    )
    geoms = [model.geom(n).id for n in ("1/rod", "3/rod", "4/wheel")]
    for geom in geoms:
        radius, half = model.geom_size[geom, :2]
        matrix = data.geom_xmat[geom].reshape(3, 3)
        local = (corners - data.geom_xpos[geom]) @ matrix
        rim = np.hypot(local[..., 0], local[..., 1]) - radius
        off = np.maximum(np.abs(rim), np.abs(np.abs(local[..., 2]) - half))
        assert (off.max(axis=1) < 1e-6).sum() == 4
    # Each of the other geoms is one box.
    assert len(corners) == model.ngeom - 3 + 3 * 4
    wheel = np.linalg.norm(centres[0] - data.geom_xpos[geoms[-1]], axis=1)
    assert (wheel < 1e-6).sum() == 4


def _apart(first: Floats, second: Floats) -> float:
    """Return how far each corner of a box is from the nearest of another, at most."""
    distances = np.linalg.norm(first[:, None] - second[None], axis=-1)
    return float(distances.min(axis=1).max())


def test_a_plain_model_has_one_box_per_part_and_segment() -> None:
    drawn = box_model(ROBOT, BUILT_IN, is_plain=True)
    assert len(drawn.half_sizes) == len(ROBOT.parts) + 3
    assert len(drawn.parents) == 4


def test_a_plain_model_covers_the_same_space() -> None:
    root, angles = np.array([[0.0, 0, 0, 1, 0, 0, 0]]), np.zeros((1, 3))
    plain = box_model(ROBOT, BUILT_IN, is_plain=True)
    whole = box_model(ROBOT, BUILT_IN, is_plain=False)
    near, far = place(plain, root, angles)[0], place(whole, root, angles)[0]
    for centre in near[0]:
        assert np.linalg.norm(far[0] - centre, axis=1).min() < 0.02


def test_boxes_share_few_attitudes() -> None:
    drawn = box_model(ROBOT, BUILT_IN, is_plain=False)
    # Four segments, and the tilts beyond the bar.
    assert len(np.unique(drawn.attitude_of)) <= 6


def test_boxes_have_the_colours_of_their_parts() -> None:
    drawn = box_model(ROBOT, BUILT_IN, is_plain=True)
    assert {tuple(colour) for colour in drawn.colours.tolist()} == {
        (51, 102, 153),
        (255, 0, 128),
    }


def test_a_standing_robot_touches_the_ground() -> None:
    built = robot_spec(ROBOT, BUILT_IN, Simulation())
    drawn = box_model(ROBOT, BUILT_IN, is_plain=False)
    centres, attitudes = neutral_pose(drawn, (2.0, -1.0))
    corners = np.concatenate(
        [
            _own_corners(*each)
            for each in zip(centres[0], attitudes[0], drawn.half_sizes, strict=True)
        ]
    )
    assert corners[:, 2].min() == pytest.approx(0.0, abs=1e-6)
    core = int(np.argmax(drawn.half_sizes.prod(axis=1)))
    assert centres[0, core] == pytest.approx((2.0, -1.0, built.height), abs=1e-6)


def test_poses_of_another_body_are_refused() -> None:
    """Angles of another number made NumPy fail, or shifted all of a robot's."""
    kinds = [Part("Core", -1, -1, -1, 0, (0.5, 0.5, 0.5))]
    kinds += [Part("ActiveHinge", 0, slot, 0, 0, (0.5, 0.5, 0.5)) for slot in (0, 1)]
    model = box_model(Robot(tuple(kinds)), BUILT_IN, is_plain=True)
    births = [BirthId(0, 0), BirthId(0, 1)]
    for joints in ((1, 1), (1, 3), (2, 1)):
        rows = dict(zip(births, joints, strict=True))
        columns = read_columns("poses", poses(births, 0.2, joints=rows))
        with pytest.raises(MalformedMessage, match="must have 2 angles each"):
            place_rows(model, columns)
    two = read_columns("poses", poses(births, 0.2, joints=dict.fromkeys(births, 2)))
    assert place_rows(model, two)[0].shape[0] == 2
