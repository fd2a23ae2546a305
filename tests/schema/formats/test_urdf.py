"""URDF: MuJoCo reads it with the same masses and poses."""

from dataclasses import replace
from pathlib import Path

import mujoco
import numpy as np
import pytest
from hypothesis import given, settings
from msgspec.structs import replace as changed

from schema.errors import InvalidRobot
from schema.experiment.document import Simulation
from schema.formats.files import read_robot, write_robot
from schema.formats.urdf import robot_to_urdf
from schema.limits import MOST_MJCF_BYTES
from schema.mjcf.model import robot_spec
from schema.parts import BUILT_IN
from schema.plugins.bounded import parse_xml
from schema.robogen_parts import ACTIVE_WHEEL, WHEEL
from schema.robot.robot import Part, Robot
from tests.schema.robots import GREY, random_robots, robot_of

SIMULATION = Simulation()


def test_wheels_become_continuous_joints_and_cylinders() -> None:
    """Of the driven wheel: radius 60 mm, 3 mm thick, 0.3924 N m, 5.236 rad/s."""
    wheel = (60.0, *GREY)
    space = {**BUILT_IN, "ActiveWheel": ACTIVE_WHEEL, "Wheel": WHEEL}
    wheels = (Part("ActiveWheel", 0, 2, 0, 0, wheel), Part("Wheel", 0, 3, 0, 0, wheel))
    robot = robot_of(*wheels, space=space)
    root = parse_xml(robot_to_urdf(robot, space, SIMULATION), MOST_MJCF_BYTES)
    driven, free = root.iter("joint")
    assert [each.get("type") for each in (driven, free)] == ["continuous"] * 2
    limits = driven.find("limit")
    assert limits is not None
    assert limits.attrib == {"effort": "0.3924", "velocity": "5.236"}
    shapes = [each.attrib for each in root.iter("cylinder")]
    assert shapes == [{"radius": "0.06", "length": "0.003"}] * 4
    ours = robot_spec(robot, space, SIMULATION).spec.compile()
    theirs = mujoco.MjSpec.from_string(
        robot_to_urdf(robot, space, SIMULATION)
    ).compile()
    kind = mujoco.mjtGeom.mjGEOM_CYLINDER
    assert (theirs.geom_type == kind).sum() == (ours.geom_type == kind).sum() == 2
    assert [bool(theirs.jnt_limited[j]) for j in range(theirs.njnt)] == [False] * 2


def test_a_slider_becomes_a_prismatic_joint() -> None:
    shape = BUILT_IN["ActiveHinge"].shape(GREY)
    assert shape.joint is not None
    sliding = changed(shape.joint, kind="prismatic", limit=0.012)
    slide = replace(BUILT_IN["Hinge"], shape=lambda _: changed(shape, joint=sliding))
    space = {**BUILT_IN, "Hinge": slide}
    text = robot_to_urdf(robot_of(Part("Hinge", 0, 2, 0, 0, GREY)), space, SIMULATION)
    (joint,) = parse_xml(text, MOST_MJCF_BYTES).iter("joint")
    assert joint.get("type") == "prismatic"
    limits = joint.find("limit")
    assert limits is not None
    assert (limits.get("lower"), limits.get("upper")) == ("-0.012", "0.012")


@settings(max_examples=25, deadline=None)
@given(robot=random_robots())
def test_urdf_moves_like_the_robot(robot: Robot) -> None:
    ours = robot_spec(robot, BUILT_IN, SIMULATION).spec.compile()
    spec = mujoco.MjSpec.from_string(robot_to_urdf(robot, BUILT_IN, SIMULATION))
    # The root segment must stay a body of its own to be compared.
    spec.compiler.fusestatic = False
    theirs = spec.compile()
    angles = np.random.default_rng(1).uniform(-0.7, 0.7, ours.njnt - 1)
    one, other = mujoco.MjData(ours), mujoco.MjData(theirs)
    one.qpos[7:] = angles
    for joint in range(1, ours.njnt):
        same = theirs.joint(ours.joint(joint).name)
        other.qpos[same.qposadr[0]] = angles[joint - 1]
        assert same.range == pytest.approx(ours.jnt_range[joint], abs=1e-9)
    mujoco.mj_kinematics(ours, one)
    mujoco.mj_kinematics(theirs, other)
    for body in range(1, ours.nbody):
        name = ours.body(body).name
        # MuJoCo makes the root link part of the world.
        same_body = 0 if name == "root" else theirs.body(name).id
        assert other.xpos[same_body] == pytest.approx(one.xpos[body], abs=1e-9)
        if same_body:
            mass = theirs.body_mass[same_body]
            assert mass == pytest.approx(ours.body_mass[body], rel=1e-9)
            centre = other.xipos[same_body]
            assert centre == pytest.approx(one.xipos[body], abs=1e-9)
            inertia = np.sort(theirs.body_inertia[same_body])
            expected = np.sort(ours.body_inertia[body])
            assert inertia == pytest.approx(expected, rel=1e-6)


def test_limits_of_driven_and_free_hinges() -> None:
    hinges = Part("ActiveHinge", 0, 0, 0, 0, GREY), Part("Hinge", 0, 1, 0, 0, GREY)
    robot = robot_of(*hinges)
    text = robot_to_urdf(robot, BUILT_IN, SIMULATION)
    # 1.8 kg cm and 50 rpm within 45 degrees; 60 degrees without a motor.
    assert 'lower="-0.785398' in text
    assert 'effort="0.17658" velocity="5.236"' in text
    assert 'lower="-1.047197' in text
    assert 'effort="0.0"' in text
    weak = robot_to_urdf(robot, BUILT_IN, changed(SIMULATION, torque_factor=0.5))
    assert 'effort="0.08829" velocity="5.236"' in weak


def test_urdf_is_not_read(tmp_path: Path) -> None:
    path = tmp_path / "core.urdf"
    write_robot(robot_of(), path)
    assert path.read_text().startswith("<?xml")
    with pytest.raises(InvalidRobot, match=r"must end in one of .*, got '\.urdf'"):
        read_robot(path)


def test_a_body_that_the_engine_cannot_build_is_refused() -> None:
    tiny = changed(SIMULATION, mass_factor=1e-9)
    robot = robot_of(Part("Hinge", 0, 2, 0, 0, GREY))
    with pytest.raises(InvalidRobot, match=r"^cannot be built: .*inertia must .*body1"):
        robot_to_urdf(robot, BUILT_IN, tiny)
