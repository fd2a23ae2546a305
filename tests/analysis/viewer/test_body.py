"""Tests of box models: MuJoCo has the same boxes in every pose."""

import itertools

import mujoco
import numpy as np
import pytest

from analysis.viewer.body import BoxModel, box_model, neutral_pose, place, place_rows
from schema.errors import MalformedMessage
from schema.experiment.document import Simulation
from schema.mjcf.model import robot_spec
from schema.parts import BUILT_IN, BodySpace, PartType
from schema.robogen_parts import ACTIVE_WHEEL
from schema.robot.brain import Brain
from schema.robot.ids import BirthId
from schema.robot.robot import Part, Robot
from schema.robot.trace import Floats
from tests.coordinator.arena_world import poses
from tests.schema.robots import SLIDE

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


SIGNS = np.array(list(itertools.product((-1, 1), repeat=3)))


def _engine(
    robot: Robot, space: BodySpace, root: Floats, angles: Floats
) -> tuple[mujoco.MjModel, mujoco.MjData]:
    """Return a robot in a pose, as MuJoCo has it."""
    model = robot_spec(robot, space, Simulation()).spec.compile()
    data = mujoco.MjData(model)
    data.qpos[:7], data.qpos[7:] = root, angles
    mujoco.mj_kinematics(model, data)
    return model, data


def _corners(drawn: BoxModel, centres: Floats, attitudes: Floats) -> Floats:
    """Return the corners of each box, (B, 8, 3) for (B, 3) centres."""
    matrices = np.zeros((len(centres), 9))
    for matrix, attitude in zip(matrices, attitudes, strict=True):
        mujoco.mju_quat2Mat(matrix, attitude[[3, 0, 1, 2]].astype(np.float64))
    offsets = SIGNS * drawn.half_sizes[:, None]
    turned = offsets @ matrices.reshape(-1, 3, 3).transpose(0, 2, 1)
    return np.asarray(centres[:, None] + turned)


def _some_root(rng: np.random.Generator) -> Floats:
    root = rng.normal(size=7)
    root[3:] /= np.linalg.norm(root[3:])
    return root


@pytest.mark.parametrize("seed", range(4))
def test_boxes_are_where_the_engine_has_them(seed: int) -> None:
    rng = np.random.default_rng(seed)
    root, angles = _some_root(rng), rng.uniform(-0.7, 0.7, 3)
    drawn = box_model(ROBOT, BUILT_IN, is_plain=False)
    centres, attitudes = place(drawn, root[None], angles[None])
    boxes = _corners(drawn, centres[0], attitudes[0])
    model, data = _engine(ROBOT, BUILT_IN, root, angles)
    turned = data.geom_xmat.reshape(-1, 3, 3).transpose(0, 2, 1)
    geoms = data.geom_xpos[:, None] + (SIGNS * model.geom_size[:, None]) @ turned
    assert len(boxes) == len(geoms)
    for geom in geoms:
        # Distances of its corners to those of each box, (B, 8, 8).
        apart = np.linalg.norm(geom[None, :, None] - boxes[:, None], axis=-1)
        assert apart.min(axis=1).max(axis=1).min() < 1e-5


SPACE = {
    **BUILT_IN,
    "ActiveWheel": ACTIVE_WHEEL,
    "Slide": PartType("Slide", 2, lambda _: SLIDE),
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
    root = _some_root(rng)
    angles = np.array([0.01, 0.6, -0.015, 40.0]) * rng.uniform(-1.0, 1.0, 4)
    model, data = _engine(WHEELED, SPACE, root, angles)
    drawn = box_model(WHEELED, SPACE, is_plain=False)
    centres, attitudes = place(drawn, root[None], angles[None])
    corners = _corners(drawn, centres[0], attitudes[0])
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


def test_a_plain_model_covers_the_same_space_with_fewer_boxes() -> None:
    """One per part and segment."""
    root, angles = np.array([[0.0, 0, 0, 1, 0, 0, 0]]), np.zeros((1, 3))
    plain = box_model(ROBOT, BUILT_IN, is_plain=True)
    whole = box_model(ROBOT, BUILT_IN, is_plain=False)
    assert len(plain.half_sizes) == len(ROBOT.parts) + 3
    assert len(plain.parents) == 4
    assert {*map(tuple, plain.colours.tolist())} == {(51, 102, 153), (255, 0, 128)}
    near, far = place(plain, root, angles)[0], place(whole, root, angles)[0]
    for centre in near[0]:
        assert np.linalg.norm(far[0] - centre, axis=1).min() < 0.02
    # Attitudes are shared: those of four segments, and the tilts beyond the bar.
    assert len(np.unique(whole.attitude_of)) <= 6


def test_a_standing_robot_touches_the_ground() -> None:
    built = robot_spec(ROBOT, BUILT_IN, Simulation())
    drawn = box_model(ROBOT, BUILT_IN, is_plain=False)
    centres, attitudes = neutral_pose(drawn, (2.0, -1.0))
    corners = _corners(drawn, centres[0], attitudes[0])
    assert corners[..., 2].min() == pytest.approx(0.0, abs=1e-6)
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
        columns = poses(births, 0.2, joints=rows).rows()
        with pytest.raises(MalformedMessage, match="must have 2 angles each"):
            place_rows(model, columns)
    two = poses(births, 0.2, joints=dict.fromkeys(births, 2)).rows()
    assert place_rows(model, two)[0].shape[0] == 2
