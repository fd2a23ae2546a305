"""Where and how robots stand when a simulation begins."""

import math
from collections.abc import Iterator
from math import cos, radians, sin

import mujoco
import numpy as np
import pytest
from msgspec.structs import replace

from schema.experiment.document import Simulation
from schema.experiment.environment import FLAT, Environment, relief
from schema.mjcf.footing import footprint, standing_height
from schema.mjcf.model import robot_spec, shared_model, solo_spec
from schema.parts import BUILT_IN
from schema.robot.robot import Part, Robot
from tests.schema.robots import CORE, GREY

WORLD = Simulation()
ALONE = Robot((CORE,))
LEGGED = Robot(
    (
        CORE,
        Part("ParametricBarJoint", 0, 2, 0, 0, (90.0, 0.5, 0.0, *GREY)),
        Part("FixedBrick", 1, 1, 0, 0, GREY),
        Part("ActiveHinge", 0, 3, 0, 90, GREY),
        Part("FixedBrick", 3, 1, 0, 270, GREY),
    )
)
ROUGH = Environment(roughness_m=0.08, patch_m=0.05, extent_m=2.0, ground_seed=4)
OBSTACLES = Environment(
    scenery="""<mujoco><worldbody>
    <geom type="box" size="0.6 0.01 0.4" pos="0 0 0.4" euler="0 0 45"/>
    <geom type="box" size="0.5 0.5 0.02" pos="-0.6 -0.6 0.1" euler="10 -20 30"/>
    <geom type="sphere" size="0.3" pos="0.8 -0.4 0"/>
    <geom type="cylinder" size="0.1 0.15" pos="-0.5 0.5 0.15"/>
    <geom type="ellipsoid" size="0.3 0.2 0.1" pos="0.6 0.9 0"/>
    <geom type="capsule" fromto="-1 0.2 0.1 -0.2 1 0.1" size="0.06"/>
    </worldbody></mujoco>"""
)


def height(
    robot: Robot,
    environment: Environment,
    place: tuple[float, float] = (0.0, 0.0),
    heading: float = 0.0,
) -> float:
    model = robot_spec(robot, BUILT_IN, WORLD).spec.compile()
    return standing_height(footprint(model), WORLD, environment, place, heading)


def depths(
    robot: Robot, environment: Environment, pose: tuple[float, float, float, float]
) -> Iterator[float]:
    """Yield the penetration of a robot at x, y, z, heading [m]."""
    model = solo_spec(robot, BUILT_IN, WORLD, environment).compile()
    data = mujoco.MjData(model)
    x, y, z, heading = pose
    turn = (math.cos(heading / 2), 0.0, 0.0, math.sin(heading / 2))
    data.qpos[:7] = (x, y, z, *turn)
    mujoco.mj_forward(model, data)
    for contact in data.contact:
        if 0 in model.geom_bodyid[contact.geom]:
            yield -float(contact.dist)


def test_a_core_stands_on_a_block_and_beside_a_wall() -> None:
    """A block as high as 0.3 m lifts it by that; a slanting wall is left alone."""
    flat = height(ALONE, Environment())
    block = '<geom type="box" size="0.2 0.2 0.15" pos="0 0 0.15"/>'
    wall = '<geom type="box" size="1 0.01 0.5" pos="0.1 -0.1 0.5" euler="0 0 45"/>'
    scenes = [
        Environment(scenery=f"<mujoco><worldbody>{one}</worldbody></mujoco>")
        for one in (block, wall)
    ]
    assert height(ALONE, scenes[0]) == pytest.approx(flat + 0.3, abs=3e-5)
    assert height(ALONE, scenes[0], (1.0, 0.0)) == flat
    # 0.14 m from the core, whose corners reach 0.065 m.
    assert height(ALONE, scenes[1]) == flat
    assert height(ALONE, scenes[1], (0.1, -0.1)) == pytest.approx(flat + 1.0, abs=3e-5)


def test_geoms_that_do_not_collide_are_ignored() -> None:
    ghost = '<geom type="box" size="1 1 1" contype="0" conaffinity="0"/>'
    scene = Environment(scenery=f"<mujoco><worldbody>{ghost}</worldbody></mujoco>")
    assert height(ALONE, scene) == height(ALONE, Environment())


def test_a_core_stands_on_the_highest_node_that_it_may_touch() -> None:
    """Patches of 0.4 m about the origin's node: the core touches four of them."""
    environment = Environment(roughness_m=0.2, patch_m=0.4, extent_m=2.0)
    flat, shares = height(ALONE, Environment()), relief(environment)
    assert shares.shape == (11, 11)
    highest = 0.2 * float(shares[4:7, 4:7].max())
    assert height(ALONE, environment) == pytest.approx(flat + highest)
    # Inside of the patch between x 0.4 and 0.8, y -0.4 and 0.
    highest = 0.2 * float(shares[4:6, 6:8].max())
    assert height(ALONE, environment, (0.6, -0.2)) == pytest.approx(flat + highest)
    for place in ((2.5, 0.0), (0.0, -9.0), (-3.0, 3.0)):
        assert height(ALONE, environment, place) == flat


def test_model_and_footing_use_the_same_heights() -> None:
    model = solo_spec(ALONE, BUILT_IN, WORLD, ROUGH).compile()
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    data.geom_xpos[model.geom_bodyid > 0] = (50.0, 0.0, 0.0)
    shares, hit = relief(ROUGH), np.zeros(1, dtype=np.int32)
    for row, column in ((40, 40), (10, 60), (71, 22), (80, 3)):
        spot = np.array([0.05 * column - 2.0, 0.05 * row - 2.0, 1.0])
        spot[:2] += 1e-9
        down = np.array([0.0, 0.0, -1.0])
        fall = mujoco.mj_ray(model, data, spot, down, None, 1, -1, hit)
        assert 1.0 - fall == pytest.approx(0.08 * shares[row, column], abs=1e-6)


@pytest.mark.parametrize("environment", [ROUGH, OBSTACLES], ids=["rough", "scenery"])
def test_no_robot_starts_inside_of_ground_or_scenery(environment: Environment) -> None:
    """At random places and headings: free, and at scenery not a millimetre too high."""
    rng = np.random.default_rng(5)
    flat, lifted = height(LEGGED, Environment()), 0
    for _ in range(60):
        x, y = rng.uniform(-1.2, 1.2, 2).tolist()
        heading = float(rng.uniform(0.0, 2.0 * math.pi))
        z = height(LEGGED, environment, (x, y), heading)
        assert flat <= z < flat + 1.0
        assert max(depths(LEGGED, environment, (x, y, z, heading)), default=0.0) < 1e-5
        if z > flat + 1e-3 and environment.scenery:
            lifted += 1
            below = (x, y, z - 1e-3, heading)
            assert max(depths(LEGGED, environment, below), default=0.0) > 1e-4
    assert lifted > 15 or not environment.scenery


def test_single_robot_starts_on_the_ground_at_the_origin() -> None:
    model = solo_spec(LEGGED, BUILT_IN, Simulation(drop_m=0.5), ROUGH).compile()
    assert model.qpos0[2] == pytest.approx(height(LEGGED, ROUGH) + 0.5, abs=1e-12)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    assert data.ncon == 0


@pytest.mark.parametrize("environment", [ROUGH, OBSTACLES], ids=["rough", "scenery"])
def test_two_builds_are_equal_to_the_last_bit(environment: Environment) -> None:
    """Ground and scenery of a robot alone and of robots together, too."""
    one, two = (
        solo_spec(LEGGED, BUILT_IN, WORLD, environment).compile() for _ in range(2)
    )
    child = robot_spec(ALONE, BUILT_IN, WORLD).spec
    many = shared_model([("a/", child), ("b/", child)], WORLD, environment)
    for name in ("qpos0", "geom_pos", "geom_quat", "geom_size", "hfield_data"):
        assert getattr(one, name).tobytes() == getattr(two, name).tobytes()
    assert one.hfield_data.tobytes() == many.hfield_data.tobytes()
    still = one.geom_bodyid == 0
    assert still.sum() == (many.geom_bodyid == 0).sum()
    for name in ("geom_pos", "geom_quat", "geom_size", "geom_friction", "geom_solref"):
        ours = getattr(one, name)[still]
        assert ours.tobytes() == getattr(many, name)[many.geom_bodyid == 0].tobytes()


HINGED = Robot((CORE, Part("ActiveHinge", 0, 0, 0, 0, GREY)))
SCENE = Simulation(drop_m=0.01)


def compiled(
    world: Simulation, robot: Robot = HINGED, environment: Environment = FLAT
) -> mujoco.MjModel:
    return solo_spec(robot, BUILT_IN, world, environment).compile()


@pytest.mark.parametrize("roughness_m", [0.0, 1e-9])
def test_a_rolled_core_stands_on_its_edge(roughness_m: float) -> None:
    """Compare with the lowest corner of a turned box, on a plane and beside one."""
    rolled = replace(SCENE, start_deg=(30.0, 0.0, 0.0))
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
    model = compiled(replace(SCENE, start_deg=(90.0, 0.0, 90.0)))
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    turned = data.body("root").xmat.reshape(3, 3)
    # About x first: y goes up, z goes to -y; about z then: x to y, -y to x.
    wanted = [[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]
    assert np.abs(turned - wanted).max() < 1e-12


def test_no_turned_robot_begins_in_the_ground() -> None:
    for angles in ((40.0, 0.0, 0.0), (-10.0, 70.0, 5.0), (180.0, 0.0, 0.0)):
        model = compiled(replace(SCENE, drop_m=0.0, start_deg=angles))
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
    before = compiled(SCENE)
    after = compiled(replace(SCENE, mass_factor=2.0, torque_factor=0.5))
    assert np.array_equal(after.body_mass, 2.0 * before.body_mass)
    assert after.body_inertia == pytest.approx(2.0 * before.body_inertia)
    assert np.array_equal(after.actuator_forcerange, 0.5 * before.actuator_forcerange)
    assert before.actuator_forcerange.any()
    assert np.array_equal(after.qpos0, before.qpos0)
