"""Start attitude, masses and torques that the simulation's settings change."""

from math import cos, radians, sin

import mujoco
import numpy as np
import pytest
from msgspec.structs import replace

from schema.experiment.document import Simulation
from schema.experiment.environment import FLAT, Environment
from schema.mjcf.model import solo_spec
from schema.parts import BUILT_IN
from schema.robot.robot import Part, Robot
from tests.schema.robots import CORE, GREY

HINGED = Robot((CORE, Part("ActiveHinge", 0, 0, 0, 0, GREY)))
WORLD = Simulation(drop_m=0.01)


def compiled(
    world: Simulation, robot: Robot = HINGED, environment: Environment = FLAT
) -> mujoco.MjModel:
    return solo_spec(robot, BUILT_IN, world, environment).compile()


@pytest.mark.parametrize("roughness_m", [0.0, 1e-9])
def test_a_rolled_core_stands_on_its_edge(roughness_m: float) -> None:
    """Compare with the lowest corner of a turned box, on a plane and beside one."""
    rolled = replace(WORLD, start_deg=(30.0, 0.0, 0.0))
    ground = Environment(roughness_m=roughness_m)
    model = compiled(rolled, Robot((CORE,)), ground)
    box = BUILT_IN["Core"].shape(CORE.parameters[:-3]).boxes[0]
    _, width, height = box.size
    angle = radians(30.0)
    lowest = 0.5 * width * sin(angle) + 0.5 * height * cos(angle)
    assert model.qpos0[2] == pytest.approx(0.01 + lowest, abs=2e-8)
    half = 0.5 * angle
    assert model.qpos0[3:7] == pytest.approx([cos(half), sin(half), 0.0, 0.0])


def test_roll_pitch_and_yaw_turn_about_the_axes_of_the_world() -> None:
    model = compiled(replace(WORLD, start_deg=(90.0, 0.0, 90.0)))
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    turned = data.body("root").xmat.reshape(3, 3)
    # About x first: y goes up, z goes to -y; about z then: x to y, -y to x.
    wanted = [[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]
    assert np.abs(turned - wanted).max() < 1e-12


def test_no_turned_robot_begins_in_the_ground() -> None:
    for angles in ((40.0, 0.0, 0.0), (-10.0, 70.0, 5.0), (180.0, 0.0, 0.0)):
        model = compiled(replace(WORLD, drop_m=0.0, start_deg=angles))
        data = mujoco.MjData(model)
        mujoco.mj_forward(model, data)
        signs = np.array(np.meshgrid(*[[-1, 1]] * 3)).reshape(3, -1)
        boxes = model.geom_type == mujoco.mjtGeom.mjGEOM_BOX
        lowest = min(
            (data.geom_xpos[each] + (data.geom_xmat[each].reshape(3, 3)
             @ (model.geom_size[each][:, None] * signs)).T)[:, 2].min()
            for each in np.flatnonzero(boxes)
        )  # fmt: skip
        assert lowest == pytest.approx(0.0, abs=1e-12)


def test_factors_scale_masses_and_torques() -> None:
    before = compiled(WORLD)
    after = compiled(replace(WORLD, mass_factor=2.0, torque_factor=0.5))
    assert np.array_equal(after.body_mass, 2.0 * before.body_mass)
    assert after.body_inertia == pytest.approx(2.0 * before.body_inertia)
    assert np.array_equal(after.actuator_forcerange, 0.5 * before.actuator_forcerange)
    assert before.actuator_forcerange.any()
    assert np.array_equal(after.qpos0, before.qpos0)
