"""MuJoCo models of robots: masses, sizes, joints, height; numbers of the original."""

import math
from collections.abc import Mapping

import mujoco
import numpy as np
import pytest

from schema.experiment.document import Simulation
from schema.experiment.environment import FLAT
from schema.mjcf.model import (
    add_ground,
    robot_spec,
    set_options,
    shared_model,
    solo_spec,
)
from schema.parts import BUILT_IN
from schema.robot.robot import Part, Robot
from tests.schema.robots import CORE, GREY

WORLD = Simulation()
KINDS: Mapping[str, tuple[float, ...]] = {
    "FixedBrick": GREY,
    "ActiveHinge": GREY,
    "Hinge": GREY,
    "ParametricBarJoint": (80.0, 0.5, 0.0, *GREY),
    "TouchSensor": GREY,
}


def on_core(kind: str, slot: int = 0, turn: int = 0, parent_slot: int = 2) -> Robot:
    """Return a core with one part."""
    return Robot((CORE, Part(kind, 0, parent_slot, slot, turn, KINDS[kind])))


def model_of(robot: Robot, simulation: Simulation = WORLD) -> mujoco.MjModel:
    return solo_spec(robot, BUILT_IN, simulation, FLAT).compile()


def body_mass(model: mujoco.MjModel, name: str) -> float:
    """Return the mass of a body in grams."""
    return float(model.body(name).mass[0]) * 1000


@pytest.mark.parametrize(
    ("kind", "grams"),
    [
        ("FixedBrick", 10.2),
        ("ActiveHinge", 24.2),
        ("Hinge", 6.0),
        ("ParametricBarJoint", 2 + 0.02 * 80),
        ("TouchSensor", 9.0),
    ],
)
def test_mass_of_a_robot_is_the_sum_of_its_parts(kind: str, grams: float) -> None:
    model = model_of(on_core(kind))
    assert model.body_mass.sum() * 1000 == pytest.approx(90 + grams, abs=1e-9)


@pytest.mark.parametrize(
    ("kind", "slot", "near", "far"),
    [("ActiveHinge", 0, 8.2, 16.0), ("ActiveHinge", 1, 16.0, 8.2), ("Hinge", 0, 3, 3)],
)
def test_joint_divides_the_boxes_into_two_segments(
    kind: str, slot: int, near: float, far: float
) -> None:
    model = model_of(on_core(kind, slot))
    assert model.nbody == 3
    assert body_mass(model, "root") == pytest.approx(90 + near, abs=1e-9)
    assert body_mass(model, "body1") == pytest.approx(far, abs=1e-9)


def test_inertia_is_that_of_uniform_boxes() -> None:
    """The core alone: m (y^2 + z^2) / 12 and so on."""
    model = model_of(Robot((CORE,)))
    flat, upright = 0.09 * (0.09**2 + 0.045**2) / 12, 0.09 * 2 * 0.09**2 / 12
    assert sorted(model.body("root").inertia) == pytest.approx([flat, flat, upright])


def test_rigid_parts_become_one_body() -> None:
    parts = (
        CORE,
        Part("FixedBrick", 0, 0, 2, 0, GREY),
        Part("FixedBrick", 1, 0, 0, 0, GREY),
    )
    model = model_of(Robot(parts))
    assert (model.nbody, model.nv, model.ngeom) == (2, 6, 4)


@pytest.mark.parametrize(("kind", "degrees"), [("ActiveHinge", 45), ("Hinge", 60)])
def test_joint_ranges_are_those_of_the_original(kind: str, degrees: float) -> None:
    joint = model_of(on_core(kind)).joint("joint1")
    assert joint.range == pytest.approx(
        [-math.radians(degrees), math.radians(degrees)], abs=1e-12
    )


def test_only_driven_joints_have_a_servo_of_its_torque() -> None:
    parts = (
        CORE,
        Part("Hinge", 0, 0, 0, 0, GREY),
        Part("ActiveHinge", 0, 2, 0, 0, GREY),
    )
    model = model_of(Robot(parts))
    assert model.nu == 1
    assert model.actuator_forcerange.tolist() == [[-0.17658, 0.17658]]
    assert model.joint("joint1").armature == WORLD.armature
    assert model.joint("joint2").armature == WORLD.servo_armature
    assert (model.dof_armature[:6] == 0).all()
    assert (model.dof_damping[:6] == 0).all()


@pytest.mark.parametrize("slot", [0, 1])
@pytest.mark.parametrize(("kind", "axis"), [("ActiveHinge", -1), ("Hinge", 1)])
def test_the_angle_is_that_of_segment_1_against_segment_0(
    kind: str, axis: int, slot: int
) -> None:
    """Part frames: an active hinge turns about -y, a passive one about +z."""
    model = model_of(on_core(kind, slot))
    data = mujoco.MjData(model)
    data.joint("joint1").qpos = 0.3
    mujoco.mj_forward(model, data)
    names = (
        ("1/servo", "1/frame") if kind == "ActiveHinge" else ("1/conn_b", "1/conn_a")
    )
    beyond, base = (data.geom(name).xmat.reshape(3, 3) for name in names)
    turn = base.T @ beyond
    expected = np.empty(4)
    local = np.array([0.0, axis, 0.0] if kind == "ActiveHinge" else [0.0, 0.0, axis])
    mujoco.mju_axisAngle2Quat(expected, local, 0.3)
    matrix = np.empty(9)
    mujoco.mju_quat2Mat(matrix, expected)
    assert turn == pytest.approx(matrix.reshape(3, 3), abs=1e-12)


@pytest.mark.parametrize("turn", [0, 90])
@pytest.mark.parametrize("kind", sorted(KINDS))
def test_planar_robots_stand_on_the_core(kind: str, turn: int) -> None:
    turn = 0 if BUILT_IN[kind].is_levelled else turn
    model = model_of(on_core(kind, 0, turn))
    assert model.qpos0[2] == pytest.approx(0.0225, abs=1e-12)
    lifted = model_of(on_core(kind, 0, turn), Simulation(drop_m=0.25))
    assert lifted.qpos0[2] == pytest.approx(0.2725, abs=1e-12)


def test_a_robot_on_its_edge_stands_higher() -> None:
    """A bar that bends downwards reaches below the core."""
    bar = Part("ParametricBarJoint", 0, 2, 0, 270, (100.0, 1.0, 0.0, *GREY))
    brick = Part("FixedBrick", 1, 1, 0, 0, GREY)
    model = model_of(Robot((CORE, bar, brick)))
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    lowest = min(
        float(data.geom_xpos[i, 2] - np.abs(data.geom_xmat[i][6:]) @ model.geom_size[i])
        for i in range(model.ngeom)
        if model.geom_type[i] == mujoco.mjtGeom.mjGEOM_BOX
    )
    assert model.qpos0[2] != pytest.approx(0.0225, abs=1e-3)
    assert lowest == pytest.approx(0.0, abs=1e-12)


def test_one_spec_can_be_attached_to_a_world_twice() -> None:
    """Same robot, own names, contiguous elements, the solo model's numbers."""
    robot = on_core("ActiveHinge", 1, 90)
    solo = model_of(robot)
    child = robot_spec(robot, BUILT_IN, WORLD)
    world = mujoco.MjSpec()
    set_options(world, WORLD, FLAT, is_single=False)
    add_ground(world, WORLD, FLAT)
    for number, x in ((7, 0.0), (8, 1.0)):
        frame = world.worldbody.add_frame(pos=(x, 0.0, child.height))
        world.attach(child.spec, frame=frame, prefix=f"{number}:")
    model = world.compile()
    assert (model.nq, model.nu) == (2 * solo.nq, 2 * solo.nu)
    for number in (7, 8):
        for name in ("root", "body1"):
            assert model.body(f"{number}:{name}").mass == solo.body(name).mass
        joint, alone = model.joint(f"{number}:joint1"), solo.joint("joint1")
        assert joint.range.tolist() == alone.range.tolist()
        assert joint.axis.tolist() == alone.axis.tolist()
        assert joint.armature == alone.armature
    assert model.joint("8:free").qposadr == solo.nq
    assert model.qpos0[solo.nq : solo.nq + 3] == pytest.approx([1, 0, 0.0225])
    assert (
        model.geom("8:1/servo").solref.tolist() == solo.geom("1/servo").solref.tolist()
    )


def chain(parts: int) -> Robot:
    """Return a core with a chain of hinges."""
    hinges = (
        Part("ActiveHinge", index, 1 if index else 0, 0, 0, GREY)
        for index in range(parts - 1)
    )
    return Robot((CORE, *hinges))


@pytest.mark.parametrize(
    ("parts", "mebibytes"), [(2, 1), (30, 1), (31, 2), (60, 4), (61, 5), (300, 100)]
)
def test_memory_grows_with_the_square_of_the_parts(parts: int, mebibytes: int) -> None:
    """Robots of up to 30 parts all have 1 MiB, twice that among others."""
    assert model_of(chain(parts)).narena == mebibytes << 20
    child = robot_spec(chain(parts), BUILT_IN, WORLD).spec
    core = robot_spec(Robot((CORE,)), BUILT_IN, WORLD).spec
    shared = shared_model([("a/", child), ("b/", core)], WORLD, FLAT)
    assert shared.narena == 2 * (mebibytes + 1) << 20


def test_memory_is_enough_for_a_long_robot_that_lies_on_the_ground() -> None:
    """All its hinges touch the ground; the engine raises if its memory is full."""
    model = model_of(chain(120))
    data = mujoco.MjData(model)
    mujoco.mj_step(model, data, 50)
    assert data.ncon > 300
    assert not data.warning.number.any()
    assert 1 << 20 < data.maxuse_arena < model.narena // 2


def test_memory_has_no_effect_on_a_robot_that_needs_less() -> None:
    spec = solo_spec(chain(40), BUILT_IN, WORLD, FLAT)
    states = []
    for memory in (1 << 20, spec.memory):
        spec.memory = memory
        model = spec.compile()
        data = mujoco.MjData(model)
        mujoco.mj_step(model, data, 100)
        states.append((data.qpos.tobytes(), data.qvel.tobytes()))
    assert spec.memory == 2 << 20
    assert states[0] == states[1]
