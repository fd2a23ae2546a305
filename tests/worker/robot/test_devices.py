"""Sensor readings and motor commands, compared with the engine's numbers."""

import math
from collections.abc import Callable, Iterator

import mujoco
import numpy as np
import pytest
from msgspec.structs import replace

from schema.experiment.document import Simulation
from schema.experiment.environment import FLAT
from schema.mjcf.model import add_ground, robot_spec, set_options, solo_spec
from schema.parts import BUILT_IN, CORE, BodySpace, PartType, Sensor
from schema.robot.robot import Part, Robot
from tests.schema import robots
from worker.robot.devices import Sensors, Servos
from worker.robot.placed import PlacedRobot

GREY = robots.GREY
WORLD = Simulation()
TICK_S = 0.125
HINGED = robots.robot_of(
    Part("ActiveHinge", 0, 2, 0, 90, GREY), Part("FixedBrick", 1, 1, 0, 270, GREY)
)


def alone(
    robot: Robot, simulation: Simulation = WORLD, space: BodySpace = BUILT_IN
) -> tuple[mujoco.MjModel, mujoco.MjData]:
    """Return model and data of one robot on the ground."""
    model = solo_spec(robot, space, simulation, FLAT).compile()
    return model, mujoco.MjData(model)


def two(pair: tuple[Robot, Robot]) -> tuple[mujoco.MjModel, mujoco.MjData]:
    """Return model and data of two robots, ``1:`` and ``2:``, half a metre apart."""
    world = mujoco.MjSpec()
    set_options(world, WORLD, FLAT, is_single=False)
    add_ground(world, WORLD, FLAT)
    for number, robot in enumerate(pair, start=1):
        child = robot_spec(robot, BUILT_IN, WORLD)
        turn = (math.cos(number / 2), 0.0, 0.0, math.sin(number / 2))
        frame = world.worldbody.add_frame(
            pos=(0.5 * number, 0.0, child.height), quat=turn
        )
        world.attach(child.spec, frame=frame, prefix=f"{number}:")
    model = world.compile()
    return model, mujoco.MjData(model)


def ticks(
    model: mujoco.MjModel, data: mujoco.MjData, sensors: list[Sensors], count: int
) -> Iterator[int]:
    """Step and read for some ticks, yielding after each."""
    for each in sensors:
        each.start()
    for tick in range(count):
        mujoco.mj_step(model, data, nstep=25)
        for each in sensors:
            each.read(TICK_S)
        yield tick


def test_two_robots_of_one_model_read_gravity_upward(turtle: Robot) -> None:
    model, data = two((turtle, HINGED))
    sensors = [
        Sensors(PlacedRobot(turtle, BUILT_IN, model, data, "1:"), width=10),
        Sensors(PlacedRobot(HINGED, BUILT_IN, model, data, "2:"), width=10),
    ]
    for _ in ticks(model, data, sensors, 16):
        pass
    for each in sensors:
        assert each.readings[0, :6] == pytest.approx([0, 0, 9.81, 0, 0, 0], abs=0.01)


def test_gravity_is_read_in_the_frame_of_the_core() -> None:
    """Turned a quarter about +x, the core's +y points up."""
    model, data = alone(HINGED, replace(WORLD, drop_m=1.0))
    data.qpos[3:7] = (math.sqrt(0.5), math.sqrt(0.5), 0.0, 0.0)
    sensors = Sensors(PlacedRobot(HINGED, BUILT_IN, model, data), width=10)
    assert sensors.start()[0, :3] == pytest.approx([0, 9.81, 0], abs=1e-9)


def test_accelerometer_of_a_falling_robot_reads_zero() -> None:
    model, data = alone(HINGED, replace(WORLD, drop_m=5.0))
    sensors = Sensors(PlacedRobot(HINGED, BUILT_IN, model, data), width=10)
    for _ in ticks(model, data, [sensors], 3):
        assert sensors.readings[0, :3] == pytest.approx([0, 0, 0], abs=1e-9)


def test_acceleration_is_the_mean_over_the_interval() -> None:
    """Accelerated along +x by 2 m/s2 after half a turn: -2 in its own frame."""
    model, data = alone(HINGED, replace(WORLD, drop_m=5.0, gravity=0.0))
    data.qpos[3:7] = (0.0, 0.0, 0.0, 1.0)
    sensors = Sensors(PlacedRobot(HINGED, BUILT_IN, model, data), width=10)
    sensors.start()
    data.qvel[0] = 2.0 * TICK_S
    assert sensors.read(TICK_S)[0, :3] == pytest.approx([-2.0, 0.0, 0.0])


def test_gyroscope_reads_in_the_frame_of_the_core() -> None:
    model, data = alone(HINGED, replace(WORLD, drop_m=5.0, gravity=0.0))
    data.qpos[3:7] = (math.cos(0.4), math.sin(0.4), 0.0, 0.0)
    data.qvel[3:6] = (0.1, -0.2, 0.3)
    sensors = Sensors(PlacedRobot(HINGED, BUILT_IN, model, data), width=10)
    sensors.start()
    assert sensors.readings[0, 3:6] == pytest.approx([0.1, -0.2, 0.3], abs=1e-12)


def _imu_in_a_brick() -> BodySpace:
    """Return the built-in parts, with an imu in every brick and none in the core."""
    brick, core = BUILT_IN["FixedBrick"], CORE
    return {
        **BUILT_IN,
        "Core": PartType("Core", core.arity, core.shape, is_root=True),
        "FixedBrick": PartType(
            "FixedBrick", brick.arity, brick.shape, sensors=(Sensor("imu", "body"),)
        ),
    }


def test_imu_in_a_limb_agrees_with_the_engine_s_sensors() -> None:
    """Gyroscope and velocimeter at the imu's site."""
    space = _imu_in_a_brick()
    spec = robot_spec(HINGED, space, WORLD).spec
    set_options(spec, WORLD, FLAT, is_single=True)
    for name, kind in (("w", "mjSENS_GYRO"), ("v", "mjSENS_FRAMELINVEL")):
        spec.add_sensor(
            name=name,
            type=getattr(mujoco.mjtSensor, kind),
            objtype=mujoco.mjtObj.mjOBJ_SITE,
            objname="2/imu",
        )
    model = spec.compile()
    data = mujoco.MjData(model)
    data.qvel[:] = (0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7)
    sensors = Sensors(PlacedRobot(HINGED, space, model, data), width=6)
    sensors.start()
    before = data.sensor("v").data.copy()
    data.ctrl[0] = 1.0
    mujoco.mj_step(model, data, nstep=25)
    found = sensors.read(TICK_S)[0]
    mujoco.mj_forward(model, data)
    turn = data.site("2/imu").xmat.reshape(3, 3)
    change = (data.sensor("v").data - before) / TICK_S + (0, 0, 9.81)
    assert found[:3] == pytest.approx(turn.T @ change, abs=1e-9)
    assert found[3:6] == pytest.approx(data.sensor("w").data, abs=1e-9)


def test_touch_sensor_reads_contact_with_the_ground() -> None:
    """The sensor points downwards; the core stands on its two pads."""
    robot = robots.robot_of(Part("TouchSensor", 0, 2, 0, 0, GREY))
    model, data = alone(robot)
    sensors = Sensors(PlacedRobot(robot, BUILT_IN, model, data), width=10)
    assert sensors.start()[0, 6:8].tolist() == [0.0, 0.0]
    # Nose down: a quarter turn about +y sends +x to -z.
    data.qpos[2] = 0.045 + 0.0105 - 1e-4
    data.qpos[3:7] = (math.sqrt(0.5), 0.0, math.sqrt(0.5), 0.0)
    assert sensors.start()[0, 6:8].tolist() == [1.0, 1.0]
    # Tilted a little, only the lower pad is left on the ground.
    for angle in (0.05, -0.05):
        tilt = np.empty(4)
        turn = np.array([math.cos(angle), 0.0, math.sin(angle), 0.0])
        mujoco.mju_mulQuat(tilt, turn, np.array([0.5, 0.0, 0.5, 0.0]) * math.sqrt(2))
        data.qpos[3:7] = tilt
        found = sensors.start()[0, 6:8].tolist()
        heights = [data.geom(f"1/{name}").xpos[2] for name in ("left", "right")]
        assert found == [float(height == min(heights)) for height in heights]


def test_commanded_velocity_is_proportional_to_the_error(
    robot_of: Callable[[int], Robot],
) -> None:
    """Velocity = 0.9 (target - angle), with the engine's joint angles."""
    pair = (robot_of(1), robot_of(2))
    model, data = two(pair)
    servos = [
        Servos(PlacedRobot(robot, BUILT_IN, model, data, f"{number}:"))
        for number, robot in enumerate(pair, start=1)
    ]
    rng = np.random.default_rng(5)
    data.qpos[:] += rng.uniform(-0.3, 0.3, model.nq)
    outputs = [rng.uniform(-0.2, 1.2, 10) for _ in pair]
    for servo, output in zip(servos, outputs, strict=True):
        servo.drive(output)
    for number, (robot, output) in enumerate(zip(pair, outputs, strict=True), start=1):
        motors = [i for i, p in enumerate(robot.parts) if p.kind == "ActiveHinge"]
        for part, value in zip(motors, output, strict=False):
            name = f"{number}:joint{part}"
            angle = float(data.joint(name).qpos[0])
            target = -math.pi / 4 + min(max(value, 1e-5), 0.99999) * math.pi / 2
            assert data.actuator(name).ctrl == pytest.approx(0.9 * (target - angle))
    assert servos[1].actuators == slice(servos[0].actuators.stop, model.nu)


@pytest.mark.parametrize("turn", [0, 90])
def test_commanded_velocity_is_reached_and_held(turn: int) -> None:
    """Within 2 % before half of the tick, without oscillation."""
    robot = Robot((HINGED.parts[0], Part("ActiveHinge", 0, 2, 0, turn, GREY)))
    model, data = alone(robot)
    for command in (1.2, -1.2, 0.6, -0.6):
        data.ctrl[0] = command
        mujoco.mj_step(model, data, nstep=15)
        velocities = []
        for _ in range(10):
            mujoco.mj_step(model, data)
            velocities.append(float(data.qvel[6]))
        assert velocities == pytest.approx([command] * 10, rel=0.02)


def test_joint_approaches_its_target_in_about_a_second() -> None:
    """Time constant 1 / 0.9 = 1.11 s, with ticks of 0.125 s."""
    model, data = alone(HINGED)
    servos = Servos(PlacedRobot(HINGED, BUILT_IN, model, data))
    start, target = 0.0, math.pi / 4 * 0.99998
    angles = []
    for _ in range(80):
        servos.drive(np.array([1.0]))
        mujoco.mj_step(model, data, nstep=25)
        angles.append(float(data.qpos[7]))
    left = np.log((target - np.array(angles[7:24])) / (target - start))
    slope = np.polyfit(np.arange(8, 25) * TICK_S, left, 1)[0]
    # Held commands shrink the error by 1 - 0.9 * 0.125 a tick: 1.048 s.
    assert -1 / slope == pytest.approx(1.05, rel=0.05)
    assert angles[-1] == pytest.approx(target, abs=1e-3)
