"""Sliders, free joints and cylinders in MuJoCo, compared with numbers by hand."""

import math

import mujoco
import numpy as np
import pytest
from msgspec.structs import replace

from schema.experiment.document import Simulation
from schema.experiment.environment import FLAT, Environment
from schema.mjcf.footing import footprint, standing_height
from schema.mjcf.model import LEVER_M, robot_spec, solo_spec
from schema.parts import BUILT_IN, Matrix, Motor, PartType, Shape, cylinder
from schema.robogen_parts import ACTIVE_WHEEL, WHEEL
from schema.robot.robot import Part, Robot
from tests.schema.robots import CORE, GREY, SLIDE
from worker.robot.devices import Servos
from worker.robot.placed import PlacedRobot

WORLD = Simulation()
SPACE_WORLD = replace(WORLD, gravity=0.0, drop_m=5.0)
POSITION = Motor(gain=2.0, max_torque=2.0, max_velocity=0.1)
VELOCITY = Motor(gain=0.0, max_torque=2.0, max_velocity=0.1, control="velocity")
SPACE = {
    **BUILT_IN,
    "Slide": PartType("Slide", 2, lambda _: SLIDE, motor=POSITION),
    "FastSlide": PartType("FastSlide", 2, lambda _: SLIDE, motor=VELOCITY),
    "FreeSlide": PartType("FreeSlide", 2, lambda _: SLIDE),
    "Wheel": WHEEL,
    "ActiveWheel": ACTIVE_WHEEL,
}


def alone(
    robot: Robot, world: Simulation = SPACE_WORLD
) -> tuple[mujoco.MjModel, mujoco.MjData]:
    """Return model and data of a robot on the flat ground, or above it."""
    model = solo_spec(robot, SPACE, world, FLAT).compile()
    return model, mujoco.MjData(model)


@pytest.mark.parametrize(("own", "sign"), [(0, 1.0), (1, -1.0)])
def test_a_positive_displacement_moves_segment_1_along_the_axis(
    own: int, sign: float
) -> None:
    """On the face +x of the core, attached by either end."""
    robot = Robot((CORE, Part("FreeSlide", 0, 2, own, 0, GREY)))
    model, data = alone(robot)
    moved = 1 if own == 0 else 0
    name = ("1/rail", "1/rod")[moved]
    mujoco.mj_forward(model, data)
    before = data.geom(name).xpos.copy()
    data.joint("joint1").qpos = 0.01
    mujoco.mj_forward(model, data)
    assert data.geom(name).xpos - before == pytest.approx([0.01, 0, 0], abs=1e-12)
    # Segment 1 moves along the part's x axis relative to segment 0.
    along = data.geom("1/rod").xpos - data.geom("1/rail").xpos
    assert along[0] * sign == pytest.approx(0.03 + 0.01, abs=1e-12)


def test_ranges_and_reflected_inertia_of_joints() -> None:
    robot = Robot((
        CORE,
        Part("ActiveWheel", 0, 0, 0, 0, (60.0, *GREY)),
        Part("Slide", 0, 1, 0, 0, GREY),
        Part("FreeSlide", 0, 2, 0, 0, GREY),
        Part("Wheel", 0, 3, 0, 0, (40.0, *GREY)),
    ))  # fmt: skip
    model, _ = alone(robot)
    kinds = mujoco.mjtJoint
    assert [int(model.joint(f"joint{k}").type[0]) for k in (1, 2, 3, 4)] == [
        kinds.mjJNT_HINGE, kinds.mjJNT_SLIDE, kinds.mjJNT_SLIDE, kinds.mjJNT_HINGE
    ]  # fmt: skip
    assert [int(model.jnt_limited[k]) for k in (1, 2, 3, 4)] == [0, 1, 1, 0]
    assert model.joint("joint2").range.tolist() == [-0.015, 0.015]
    # A torque of 1 N m at a lever of 0.1 m is a force of 10 N; a rotor of 1 kg m2
    # there is like 100 kg.
    assert LEVER_M == 0.1
    assert model.joint("joint1").armature == [WORLD.servo_armature]
    assert model.joint("joint2").armature == pytest.approx([100 * WORLD.servo_armature])
    assert model.joint("joint3").armature == pytest.approx([100 * WORLD.armature])
    assert model.joint("joint3").damping == pytest.approx([100 * WORLD.damping])
    assert model.actuator("joint2").gainprm[0] == pytest.approx(100.0)
    assert model.actuator("joint2").forcerange.tolist() == [-2.0, 2.0]
    assert model.actuator("joint1").forcerange.tolist() == [-0.3924, 0.3924]


def test_mass_and_inertia_of_a_cylinder() -> None:
    """Rod of radius r and length l: m r2 / 2 and m (3 r2 + l2) / 12."""
    robot = Robot((CORE, Part("FreeSlide", 0, 2, 0, 0, GREY)))
    model, _ = alone(robot)
    body = model.body("body1").id
    mass, radius, length = 0.01, 0.005, 0.04
    assert model.body_mass[body] == pytest.approx(mass)
    across = mass * (3 * radius**2 + length**2) / 12
    expected = [mass * radius**2 / 2, across, across]
    assert sorted(model.body_inertia[body]) == pytest.approx(sorted(expected))


def test_a_slider_reaches_its_target_and_stays_within_its_limit() -> None:
    """At output 0.75 the target is 7.5 mm; pushed at 0.1 m/s it stops at 15 mm."""
    for kind, output, end in (("Slide", 0.75, 0.0075), ("FastSlide", 1.0, 0.015)):
        robot = Robot((CORE, Part(kind, 0, 2, 0, 0, GREY)))
        model, data = alone(robot)
        servos = Servos(PlacedRobot(robot, SPACE, model, data))
        for _ in range(40):
            servos.drive(np.array([output]))
            mujoco.mj_step(model, data, nstep=25)
        assert float(data.joint("joint1").qpos[0]) == pytest.approx(end, abs=4e-4)


def test_velocity_control_commands_velocities_from_least_to_greatest() -> None:
    robot = Robot((CORE, Part("FastSlide", 0, 2, 0, 0, GREY)))
    model, data = alone(robot)
    servos = Servos(PlacedRobot(robot, SPACE, model, data))
    data.joint("joint1").qpos = 0.01
    for output, velocity in ((0.5, 0.0), (0.75, 0.05), (7.0, 0.1), (-7.0, -0.1)):
        servos.drive(np.array([output]))
        assert data.ctrl[0] == pytest.approx(velocity, abs=3e-6)


def test_a_free_joint_turns_without_limit_at_its_velocity() -> None:
    """10 s at 5.236 rad/s: more than eight turns."""
    robot = Robot((CORE, Part("ActiveWheel", 0, 2, 0, 0, (60.0, *GREY))))
    model, data = alone(robot)
    servos = Servos(PlacedRobot(robot, SPACE, model, data))
    servos.drive(np.array([1.0]))
    mujoco.mj_step(model, data, nstep=2000)
    assert float(data.joint("joint1").qpos[0]) == pytest.approx(52.36, rel=0.01)


def test_wheels_lift_the_core_and_roll_it() -> None:
    """Two wheels of radius 60 mm: height 60 mm, velocity radius times 5.236 rad/s.

    They are on opposite faces, so equal directions need opposite commands. A brick
    that drags behind keeps the core from turning instead of the wheels; against its
    friction the wheels creep by a twelfth.
    """
    radius = 0.06
    wheel = (1000 * radius, *GREY)
    parts = [Part("ActiveWheel", 0, slot, 0, 0, wheel) for slot in (2, 3)]
    robot = Robot((CORE, Part("FixedBrick", 0, 0, 0, 0, GREY), *parts))
    model, data = alone(robot, WORLD)
    assert model.qpos0[2] == pytest.approx(radius, abs=1e-12)
    assert robot_spec(robot, SPACE, WORLD).height == pytest.approx(radius, abs=1e-12)
    servos = Servos(PlacedRobot(robot, SPACE, model, data))
    for _ in range(40):
        servos.drive(np.array([0.75, 0.25]))
        mujoco.mj_step(model, data, nstep=25)
    start = data.qpos[:2].copy()
    for _ in range(40):
        servos.drive(np.array([0.75, 0.25]))
        mujoco.mj_step(model, data, nstep=25)
    distance = 0.5 * 5.236 * radius * 5.0
    assert data.qpos[:2] - start == pytest.approx([0.0, distance], rel=0.1, abs=1e-3)


@pytest.mark.parametrize("angle", [0.0, 0.4, 1.1])
def test_a_tilted_cylinder_reaches_as_low_as_its_rim(angle: float) -> None:
    """Radius r, length l, tilted by a: r sin a + l / 2 cos a below its centre."""
    c, s = math.cos(angle), math.sin(angle)
    turn: Matrix = ((c, 0.0, s), (0.0, 1.0, 0.0), (-s, 0.0, c))
    body = cylinder("drum", 0.1, 0.06, (0.0, 0.0, 0.0), 0.1, rotation=turn)
    slots = BUILT_IN["Core"].shape(GREY).slots
    shape = Shape((body,), slots)
    space = {"Core": PartType("Core", 4, lambda _: shape, is_root=True)}
    robot = Robot((CORE,))
    lowest = 0.1 * s + 0.03 * c
    built = robot_spec(robot, space, WORLD)
    assert built.height == pytest.approx(lowest, abs=1e-12)
    boxes = footprint(built.spec.compile())
    found = standing_height(boxes, WORLD, Environment(), (0.0, 0.0), 0.0)
    assert found == pytest.approx(lowest, abs=1e-6)
