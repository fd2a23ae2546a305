"""MJCF files with a brain: round trips, and refusal of edited bodies."""

import base64
import dataclasses
import re

import msgspec
import mujoco
import numpy as np
import pytest
from hypothesis import given, settings
from msgspec.structs import replace

from schema.errors import InvalidRobot
from schema.experiment.document import Simulation
from schema.experiment.environment import Environment, relief
from schema.formats.files import settings_of
from schema.formats.mjcf import DIGEST, add_sensors, robot_from_mjcf, robot_to_mjcf
from schema.limits import MOST_MJCF_BYTES
from schema.mjcf.model import solo_spec
from schema.parts import BUILT_IN, CORE, Box, Sensor, Shape, constant_shape
from schema.plugins.bounded import parse_xml
from schema.robot.robot import Part, Robot
from tests.schema.robots import GREY, random_robots, robot_of

SETTINGS = settings_of(None)
ARM = robot_of(Part("Hinge", 0, 2, 0, 0, GREY), Part("FixedBrick", 1, 1, 0, 90, GREY))


@settings(max_examples=25, deadline=None)
@given(robot=random_robots())
def test_mjcf_round_trip(robot: Robot) -> None:
    text = robot_to_mjcf(robot, SETTINGS)
    # A repr tells -0.0 from 0.0 and every bit of a float.
    assert repr(robot_from_mjcf(text, "it")) == repr((robot, SETTINGS))


def test_mjcf_holds_the_environment() -> None:
    """Tilt of gravity, rough ground, scenery and objects, also after reading."""
    geom = '<geom type="box" size="0.1 0.1 0.1" pos="{} 0 0.1"/>'
    body = f'<body pos="0.5 0 0.1"><freejoint/>{geom.format(0.02)}</body>'
    scenery = f"<mujoco><worldbody>{geom.format(0.5)}{body}</worldbody></mujoco>"
    environment = Environment(
        slope_deg=30.0, roughness_m=0.05, extent_m=1.0, scenery=scenery, light=(1, 2, 3)
    )
    wild = replace(SETTINGS, environment=environment)
    text = robot_to_mjcf(ARM, wild)
    assert robot_from_mjcf(text, "it") == (ARM, wild)
    model = mujoco.MjModel.from_xml_string(text)
    gravity = [-9.81 * 0.5, 0.0, -9.81 * 0.75**0.5]
    assert model.opt.gravity.tolist() == pytest.approx(gravity, rel=1e-5)
    shares = model.hfield_data.reshape(21, 21)
    assert shares == pytest.approx(relief(environment), abs=1e-5)
    assert model.geom("scenery_0").pos.tolist() == [0.5, 0.0, 0.1]
    assert model.body("scenery_1").mass.item() == pytest.approx(8.0)


WALKER = robot_of(
    Part("ActiveHinge", 0, 0, 0, 0, GREY), Part("TouchSensor", 0, 1, 0, 0, GREY)
)


@pytest.mark.parametrize(
    ("written", "edited"),
    [
        ('mass="0.09"', 'mass="0.0901"'),
        ('name="body1" pos=".*?"', 'name="body1" pos="0.5 0.5 0.5"'),
        ('name="joint1"', 'name="joint1" damping="0.1"'),
        ('kv="1"', 'kv="77"'),
        ('name="2_left"', 'name="2_left" rgba="1 0 0 1"'),
        ("<gyro .*?/>", ""),
        ('<geom name="2_left".*?/>', ""),
        ('(?<="motor_gain" )data=".*?"', 'data="5"'),
        ('friction="1 0 0"', 'friction="0.1 0 0"'),
        ("<option ", '<option gravity="0 0 -1.62" '),
        ("<flag ", '<flag contact="disable" '),
        ("<worldbody>", "<worldbody><geom size='1'/>"),
        ("<worldbody>", "<include file='other.xml'/><worldbody>"),
        (r'(name="revolve_settings" data=".*?)..(?=")', r"\1AA"),
    ],
)
def test_each_edit_is_refused(written: str, edited: str) -> None:
    """What MuJoCo's viewer would obey has no effect here: it is no silent loss."""
    text = robot_to_mjcf(WALKER, SETTINGS)
    changed = re.sub(written, edited, text, count=1)
    assert changed != text
    with pytest.raises(InvalidRobot, match=r"^it: "):
        robot_from_mjcf(changed, "it")


def test_what_does_not_move_a_robot_may_be_edited() -> None:
    text = robot_to_mjcf(WALKER, SETTINGS)
    for written, edited in (
        ('name="ground"', 'name="floor" rgba="0 1 0 1"'),
        ('memory="1M"', 'memory="2M"'),
        ("<compiler", "<visual><headlight ambient='1 1 1'/></visual><compiler"),
        ("<worldbody>", "<worldbody><light pos='0 0 3'/>"),
    ):
        changed = text.replace(written, edited, 1)
        assert changed != text
        assert robot_from_mjcf(changed, "it") == (WALKER, SETTINGS)


def test_settings_that_no_longer_exist_are_left_out() -> None:
    """Files of versions that had them have no digest either."""
    text = robot_to_mjcf(WALKER, SETTINGS)
    held = msgspec.json.encode(SETTINGS)
    old = held.replace(b'"slope_deg"', b'"gap_contacts":false,"slope_deg"')
    present, earlier = (base64.b64encode(each).decode() for each in (held, old))
    edited = re.sub(f'<text name="{DIGEST}"[^>]*>', "", text.replace(present, earlier))
    assert len(edited) < len(text)
    assert earlier in edited
    assert robot_from_mjcf(edited, "it") == (WALKER, SETTINGS)


CUSTOM = '<mujoco><custom><text name="revolve_robot" data="{}"/></custom></mujoco>'


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("<mujoco", "^it: not valid MJCF: "),
        ("<mujoco><asset/></mujoco>", "^it: has no text 'revolve_robot': only MJCF"),
        (CUSTOM.format("?"), "^it: text 'revolve_robot': "),
        (CUSTOM.format(""), "^it: "),
    ],
)
def test_mjcf_without_a_robot_is_refused(text: str, message: str) -> None:
    with pytest.raises(InvalidRobot, match=message):
        robot_from_mjcf(text, "it")


def standing(text: str) -> mujoco.MjData:
    """Return the state of a robot at rest, after 10 s on the face of its slot 0."""
    model = mujoco.MjModel.from_xml_string(text)
    data = mujoco.MjData(model)
    # A quarter turn about x: slot 0, which faces -y, then faces the ground.
    data.qpos[:7] = (0.0, 0.0, 0.056, 0.5**0.5, 0.5**0.5, 0.0, 0.0)
    mujoco.mj_step(model, data, nstep=2000)
    return data


def test_sensors_for_other_tools() -> None:
    """Feelers carry a core of 90 g and themselves, 9 g; an imu reads 9.81 upwards."""
    feelers = [Part("TouchSensor", 0, slot, 0, 0, GREY) for slot in (0, 1)]
    text = robot_to_mjcf(robot_of(*feelers), SETTINGS)
    data = standing(text)
    assert data.qpos[2] == pytest.approx(0.045 + 0.0105, abs=1e-3)
    weight = (0.09 + 0.009 + 0.009) * 9.81
    left, right = (data.sensor(f"1_{side}_touch").data[0] for side in ("left", "right"))
    assert left + right == pytest.approx(weight, rel=1e-3)
    assert left == pytest.approx(right, rel=0.05)
    assert data.sensor("2_left_touch").data[0] == 0.0
    upwards = data.sensor("0_accelerometer").data
    assert upwards == pytest.approx([0.0, 9.81, 0.0], abs=0.01)
    assert data.sensor("0_gyro").data == pytest.approx([0.0] * 3, abs=1e-3)


def test_names_and_servos_that_other_tools_read() -> None:
    robot = robot_of(Part("ActiveHinge", 0, 2, 0, 0, GREY))
    scenery = '<mujoco><worldbody><geom size="0.1 0.1 0.1"/></worldbody></mujoco>'
    wild = replace(SETTINGS, environment=Environment(scenery=scenery))
    text = robot_to_mjcf(robot, wild)
    root = parse_xml(text, MOST_MJCF_BYTES)
    assert not [e for e in root.iter() if "/" in e.get("name", "")]
    (servo,) = root.iterfind("actuator/velocity")
    assert (servo.get("kv"), servo.get("input")) == ("1", None)


TILTED = robot_of(
    Part("ParametricBarJoint", 0, 1, 0, 90, (60.0, 0.3, 0.0, 0.1, 0.2, 0.3)),
    Part("ActiveHinge", 1, 1, 0, 90, GREY),
    Part("FixedBrick", 2, 1, 0, 0, GREY),
)


def test_other_tools_compile_the_same_model_to_the_last_bit() -> None:
    """With six digits a robot's fitness differed by a quarter elsewhere."""
    text = robot_to_mjcf(TILTED, SETTINGS)
    found = mujoco.MjModel.from_xml_string(text)
    ours = solo_spec(TILTED, BUILT_IN, SETTINGS.simulation, SETTINGS.environment)
    expected = ours.compile()
    names = [name for name in dir(expected) if name.startswith(("body_", "geom_"))]
    names += ["jnt_range", "jnt_axis", "dof_armature", "dof_damping", "qpos0"]
    names += ["actuator_forcerange", "actuator_gainprm", "actuator_biasprm"]
    names += ["actuator_biastype", "actuator_dyntype", "actuator_trntype"]
    for name in names:
        one, other = getattr(found, name), getattr(expected, name)
        if isinstance(one, np.ndarray) and "adr" not in name and "num" not in name:
            assert np.array_equal(one, other), name
    # Short numbers stay short, for people.
    assert 'mass="0.09"' in text
    assert 'timestep="0.005" tolerance="1e-06"' in text


def test_digits_of_mujoco_s_own_texts_stay_as_they_were() -> None:
    spec = mujoco.MjSpec()
    spec.worldbody.add_geom(size=(1 / 3, 0.0, 0.0))
    spec.compile()
    before = spec.to_xml()
    robot_to_mjcf(TILTED, SETTINGS)
    assert spec.to_xml() == before
    assert 'size="0.333333"' in before


def test_motors_have_their_limits_in_plain_mujoco() -> None:
    """50 rpm are 5.236 rad/s, and 1.8 kg cm are 0.17658 N m; a gain of 0.9 / s."""
    model = mujoco.MjModel.from_xml_string(robot_to_mjcf(TILTED, SETTINGS))
    servo = model.actuator("joint2")
    assert servo.ctrlrange.tolist() == [-5.236, 5.236]
    assert servo.forcerange.tolist() == [-0.17658, 0.17658]
    assert model.actuator_ctrllimited.tolist() == [1]
    assert model.numeric("motor_gain").data.tolist() == [0.9]


def test_files_without_a_digest_are_read() -> None:
    """As versions before 0.3 wrote them, and whatever was edited in them."""
    texts = re.findall("<text .*?/>", robot_to_mjcf(TILTED, SETTINGS))
    old = f"<mujoco><custom>{''.join(texts[:2])}</custom></mujoco>"
    assert robot_from_mjcf(old, "it") == (TILTED, SETTINGS)


def test_a_body_that_the_engine_cannot_build_is_refused() -> None:
    tiny = replace(SETTINGS, simulation=replace(SETTINGS.simulation, mass_factor=1e-9))
    with pytest.raises(InvalidRobot, match=r"^cannot be built: .*inertia must .*body1"):
        robot_to_mjcf(ARM, tiny)


def test_box_of_an_imu_may_have_its_name() -> None:
    """The names of a geom and a site do not collide."""
    plain = CORE.shape(())
    chip = Box("imu", (0.01, 0.01, 0.005), (0.0, 0.0, 0.025), 0.002)
    core = dataclasses.replace(
        CORE,
        shape=constant_shape(Shape((*plain.boxes, chip), plain.slots)),
        sensors=(Sensor("imu", "imu"), Sensor("touch", "imu")),
    )
    robot = Robot((Part("Core", -1, -1, -1, 0, GREY),))
    spec = solo_spec(robot, {"Core": core}, Simulation(), Environment())
    add_sensors(spec, robot, {"Core": core})
    model = spec.compile()
    assert [model.site(index).name for index in range(2)] == ["0_imu", "0_imu_touch"]
    assert model.geom("0_imu").size.tolist() == [0.005, 0.005, 0.0025]
    assert model.site("0_imu").pos.tolist() == [0.0, 0.0, 0.025]
    assert model.nsensor == 3
