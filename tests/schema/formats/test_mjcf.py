"""MJCF files with a brain: round trips, and refusal of edited bodies."""

import re
from pathlib import Path

import mujoco
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.strategies import DataObject, SearchStrategy
from msgspec.structs import replace

from schema.errors import InvalidRobot
from schema.experiment.environment import Environment, relief
from schema.formats.files import read_robot, settings_of, write_robot
from schema.formats.mjcf import robot_from_mjcf, robot_to_mjcf
from schema.robot.brain import INPUT, Brain, Neuron
from schema.robot.robot import Part, Robot

SETTINGS = settings_of(None)
GREY = (0.5, 0.5, 0.5)
ARM = Robot(
    (
        Part("Core", -1, -1, -1, 0, GREY),
        Part("Hinge", 0, 2, 0, 0, GREY),
        Part("FixedBrick", 1, 1, 0, 90, GREY),
    ),
    Brain(tuple(Neuron("input", INPUT, 0) for _ in range(6))),
)


@settings(max_examples=25, deadline=None)
@given(data=st.data())
def test_mjcf_round_trip(robots: SearchStrategy[Robot], data: DataObject) -> None:
    robot = data.draw(robots)
    text = robot_to_mjcf(robot, SETTINGS)
    # A repr tells -0.0 from 0.0 and every bit of a float.
    assert repr(robot_from_mjcf(text, "it")) == repr((robot, SETTINGS))


def test_mjcf_simulates_like_the_robot() -> None:
    model = mujoco.MjModel.from_xml_string(robot_to_mjcf(ARM, SETTINGS))
    # Core 90 g, hinge 6 g, brick 10.2 g: table of the parts.
    assert model.body_subtreemass[0] == pytest.approx(0.1062, rel=1e-6)
    assert model.jnt_range[1].tolist() == pytest.approx([-1.0472, 1.0472], rel=1e-4)
    assert model.opt.timestep == 0.005


def test_mjcf_holds_the_environment() -> None:
    """Tilt of gravity, rough ground and scenery, in the model and after reading."""
    box = '<geom type="box" size="0.1 0.1 0.1" pos="0.5 0 0.1"/>'
    environment = Environment(
        slope_deg=30.0,
        roughness_m=0.05,
        extent_m=1.0,
        scenery=f"<mujoco><worldbody>{box}</worldbody></mujoco>",
    )
    wild = replace(SETTINGS, environment=environment)
    text = robot_to_mjcf(ARM, wild)
    assert robot_from_mjcf(text, "it") == (ARM, wild)
    model = mujoco.MjModel.from_xml_string(text)
    gravity = [-9.81 * 0.5, 0.0, -9.81 * 0.75**0.5]
    assert model.opt.gravity.tolist() == pytest.approx(gravity, rel=1e-5)
    shares = model.hfield_data.reshape(21, 21)
    assert shares == pytest.approx(relief(environment), abs=1e-5)
    assert model.geom("scenery/0").pos.tolist() == [0.5, 0.0, 0.1]


def test_mjcf_holds_objects_that_move() -> None:
    box = '<geom type="box" size="0.1 0.1 0.1" pos="0.02 0 0"/>'
    body = f'<body pos="0.5 0 0.1"><freejoint/>{box}</body>'
    scenery = f"<mujoco><worldbody>{body}</worldbody></mujoco>"
    light = (1.0, 2.0, 3.0)
    wild = replace(SETTINGS, environment=Environment(scenery=scenery, light=light))
    text = robot_to_mjcf(ARM, wild)
    assert robot_from_mjcf(text, "it") == (ARM, wild)
    model = mujoco.MjModel.from_xml_string(text)
    assert model.body("scenery/1").mass.item() == pytest.approx(8.0)


def test_edited_body_is_refused() -> None:
    text = robot_to_mjcf(ARM, SETTINGS)
    heavier = text.replace('mass="0.0102"', 'mass="0.0104"')
    assert heavier != text
    with pytest.raises(InvalidRobot, match=r"^it: its body differs .*body_mass.*YAML"):
        robot_from_mjcf(heavier, "it")
    fewer = re.sub(r'<geom name="2/body".*?/>', "", text)
    assert fewer != text
    with pytest.raises(InvalidRobot, match=r"^it: its body differs .*\(ngeom\)"):
        robot_from_mjcf(fewer, "it")


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("<mujoco", "^it: not valid MJCF: "),
        ("<mujoco/>", "^it: has no text 'revolve_robot': only MJCF that"),
        (
            '<mujoco><custom><text name="revolve_robot" data="?"/></custom></mujoco>',
            "^it: text 'revolve_robot': ",
        ),
        (
            '<mujoco><custom><text name="revolve_robot" data=""/></custom></mujoco>',
            "^it: ",
        ),
    ],
)
def test_mjcf_without_a_robot_is_refused(text: str, message: str) -> None:
    with pytest.raises(InvalidRobot, match=message):
        robot_from_mjcf(text, "it")


def test_mjcf_files(tmp_path: Path) -> None:
    path = tmp_path / "arm.xml"
    write_robot(ARM, path)
    assert read_robot(path) == ARM
    path.write_bytes(b"\xff")
    with pytest.raises(InvalidRobot, match=r"arm\.xml: not UTF-8 text \(byte 0\)"):
        read_robot(path)
    with pytest.raises(InvalidRobot, match=r"none\.xml: cannot be read: No such file"):
        read_robot(tmp_path / "none.xml")
