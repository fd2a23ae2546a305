"""Channels of a robot that is alone, against slow oracles and hand-worked cases."""

from typing import Any

import mujoco
import numpy as np
import pytest
from msgspec.structs import replace

from schema.experiment.document import Measures, body_space
from schema.experiment.environment import Environment
from schema.experiment.file import read_experiment
from schema.experiment.settings import EvaluationSettings, evaluation_settings_of
from schema.mjcf.model import solo_spec
from schema.parts import BUILT_IN
from schema.robot.robot import Robot
from schema.robot.trace import RECORDED, Trace
from worker.robot.evaluation import evaluate, simulate
from worker.robot.placed import PlacedRobot
from worker.robot.recording import Probe

PLAIN = evaluation_settings_of(read_experiment("scenario1"))
CLOCK = replace(PLAIN.simulation, window_steps=400)


@pytest.fixture
def everything(traces: list[Trace]) -> EvaluationSettings:
    """Return settings with a measure that needs all channels."""
    assert not traces
    return replace(PLAIN, simulation=CLOCK, measures=Measures(names=("keep",)))


def states_at_ticks(robot: Robot, settings: EvaluationSettings) -> dict[float, Any]:
    found = {}

    def watch(data: mujoco.MjData) -> None:
        found[round(data.time, 6)] = (data.qpos.copy(), data.qvel.copy())

    simulate(robot, settings, watch=watch)
    return found


def test_shapes_and_states_of_all_channels(
    turtle: Robot, everything: EvaluationSettings
) -> None:
    trace = simulate(turtle, everything)
    samples, parts = 400 // CLOCK.pose_steps + 1, len(turtle.parts)
    model = solo_spec(
        turtle, body_space(PLAIN.space), CLOCK, PLAIN.environment
    ).compile()
    joints = model.nq - 7
    assert joints > 0
    assert trace.core_position.shape == (samples, 3)
    assert trace.core_attitude.shape == (samples, 4)
    for name in ("joint_angle", "joint_velocity", "joint_torque"):
        assert trace.channels[name].shape == (samples, joints)
    assert trace.energy.shape == trace.neighbours.shape == (samples,)
    assert trace.contact.shape == (samples, parts)
    assert trace.part_position.shape == (parts, 3)
    assert trace.outputs.shape == trace.commands.shape == (samples, joints)
    assert trace.part_poses.shape == (samples, parts, 7)
    assert trace.mass == pytest.approx(model.body_subtreemass[1])
    assert trace.light is None
    assert (trace.gravity, trace.robot) == (9.81, turtle)
    # Samples that fall on ticks have the states that the ticks saw.
    states = states_at_ticks(turtle, everything)
    checked = 0
    for index in range(samples):
        time = round(index * trace.interval_s, 6)
        if time in states:
            qpos, qvel = states[time]
            np.testing.assert_array_equal(trace.core_attitude[index], qpos[3:7])
            np.testing.assert_array_equal(trace.joint_angle[index], qpos[7:])
            np.testing.assert_array_equal(trace.joint_velocity[index], qvel[6:])
            checked += 1
    assert checked >= 2


@pytest.mark.parametrize("noise", [0.0, 0.1])
def test_last_readings_are_those_of_the_last_tick(
    turtle: Robot, everything: EvaluationSettings, noise: float
) -> None:
    """120 steps end between the ticks of steps 100 and 125."""
    clock = replace(CLOCK, warmup_steps=0, sensor_noise=noise)
    whole, part = (
        simulate(turtle, replace(everything, simulation=replace(clock, window_steps=n)))
        for n in (200, 120)
    )
    samples = 120 // CLOCK.pose_steps + 1
    assert CLOCK.brain_steps == 25
    np.testing.assert_array_equal(part.readings, whole.readings[:samples])
    assert not np.array_equal(part.readings[0], part.readings[-1])


def test_outputs_and_commands_are_those_of_the_last_tick(turtle: Robot) -> None:
    """Outputs follow the formula of oscillators, commands that of position servos."""
    names = ("outputs", "commands", "joint_angle")
    trace = simulate(turtle, replace(PLAIN, simulation=CLOCK, record=names))
    step, window = CLOCK.timestep_s, np.arange(400 // CLOCK.pose_steps)
    steps = CLOCK.warmup_steps + CLOCK.pose_steps * window
    ticked_s = steps // CLOCK.brain_steps * CLOCK.brain_steps * step
    for motor, phase in enumerate((0.0, 0.25)):
        angle = 2.0 * np.pi * (ticked_s / 1.5 - phase)
        expected = 0.5 + 0.5 * np.sin(angle)
        np.testing.assert_allclose(trace.outputs[:-1, motor], expected, atol=1e-9)
    motor_type = BUILT_IN["ActiveHinge"].motor
    limit = BUILT_IN["ActiveHinge"].shape((0.0,) * 3).joint.limit  # type: ignore[union-attr]
    assert motor_type is not None
    (on_tick,) = (steps % CLOCK.brain_steps == 0).nonzero()
    assert len(on_tick) >= 2
    target = limit * (2.0 * trace.outputs.clip(1e-5, 0.99999) - 1.0)
    command = motor_type.gain * (target - trace.joint_angle)
    fastest = motor_type.max_velocity
    np.testing.assert_allclose(
        trace.commands[on_tick], command.clip(-fastest, fastest)[on_tick], atol=1e-12
    )


def test_noise_reaches_commands_and_not_outputs(turtle: Robot) -> None:
    quiet = replace(PLAIN, simulation=CLOCK, record=("outputs", "commands"))
    noisy = replace(quiet, simulation=replace(CLOCK, actuator_noise=0.2))
    one, other = simulate(turtle, quiet), simulate(turtle, noisy)
    np.testing.assert_array_equal(one.outputs, other.outputs)
    assert (one.commands != other.commands).any(axis=1).all()


@pytest.mark.parametrize("start_deg", [(0.0, 0.0, 0.0), (20.0, 5.0, 130.0)])
def test_part_poses_place_the_boxes_of_the_engine(
    turtle: Robot, start_deg: tuple[float, float, float]
) -> None:
    """Boxes in the half of a part that is fixed to its parent, at each sample."""
    clock = replace(CLOCK, start_deg=start_deg)
    settings = replace(PLAIN, simulation=clock, record=("part_poses",))
    trace, space = simulate(turtle, settings), body_space(PLAIN.space)
    model = solo_spec(turtle, space, clock, PLAIN.environment).compile()
    data, checked = mujoco.MjData(model), 0
    for sample, (place, poses) in enumerate(
        zip(trace.core_position, trace.part_poses, strict=True)
    ):
        np.testing.assert_array_equal(poses[0, :3], place)
        np.testing.assert_array_equal(poses[0, 3:], trace.core_attitude[sample])
        data.qpos[:] = [
            *place,
            *trace.core_attitude[sample],
            *trace.joint_angle[sample],
        ]
        mujoco.mj_kinematics(model, data)
        for index, (part, pose) in enumerate(zip(turtle.parts, poses, strict=True)):
            shape = space[part.kind].shape(part.parameters)
            near = shape.slots[part.slot].segment if index else 0
            for box in (each for each in shape.boxes if each.segment == near):
                centre, frame = np.zeros(3), np.zeros(9)
                mujoco.mju_rotVecQuat(centre, np.array(box.position), pose[3:])
                mujoco.mju_quat2Mat(frame, pose[3:])
                geom = data.geom(f"{index}/{box.name}")
                np.testing.assert_allclose(pose[:3] + centre, geom.xpos, atol=1e-9)
                turned = frame.reshape(3, 3) @ np.asarray(box.rotation)
                np.testing.assert_allclose(turned.ravel(), geom.xmat, atol=1e-6)
                checked += 1
    assert checked > 3 * len(trace.core_position)
    assert np.ptp(trace.joint_angle, axis=0).min() > 0.1


def test_recording_changes_no_result(
    turtle: Robot, everything: EvaluationSettings
) -> None:
    plain = evaluate(turtle, replace(PLAIN, simulation=CLOCK))
    recorded = evaluate(turtle, everything)
    assert recorded.measures == (1.0,)
    assert recorded.fitness == plain.fitness
    assert recorded.path_velocity == plain.path_velocity


def test_nothing_is_recorded_without_need(turtle: Robot) -> None:
    trace = simulate(turtle, replace(PLAIN, simulation=CLOCK))
    assert set(trace.channels) == {"light", "robot", "mass", "gravity"}


def test_energy_starts_at_zero_and_rises(
    turtle: Robot, everything: EvaluationSettings
) -> None:
    late = replace(everything, simulation=replace(CLOCK, warmup_steps=200))
    trace = simulate(turtle, late)
    assert trace.energy[0] == 0.0
    assert (np.diff(trace.energy) >= 0.0).all()
    assert trace.energy[-1] > 0.0


def wheel(kv: float, limit: float) -> mujoco.MjModel:
    """Return a flywheel of 5e-3 kg m2 about a free joint's body, without gravity."""
    return mujoco.MjModel.from_xml_string(f"""
      <mujoco><option timestep="0.005" gravity="0 0 0" integrator="implicitfast"/>
      <worldbody><body name="root"><freejoint name="free"/>
        <geom name="0/core" size="0.5" mass="1e9" contype="0"/>
        <body><joint name="joint1" axis="0 0 1" armature="0.005"/>
          <geom name="1/flap" size="0.001" mass="1e-4" contype="0"/></body>
      </body></worldbody>
      <actuator><velocity name="joint1" joint="joint1" kv="{kv}"
        forcelimited="true" forcerange="-{limit} {limit}"/></actuator></mujoco>""")


@pytest.mark.parametrize(("kv", "limit"), [(1.0, 100.0), (1.0, 0.5)])
def test_work_and_torque_follow_from_the_motion_of_a_flywheel(
    turtle: Robot, kv: float, limit: float
) -> None:
    """The torque is inertia times acceleration; work is torque times rotation."""
    model = wheel(kv, limit)
    data = mujoco.MjData(model)
    data.ctrl[0] = 4.0
    probe = Probe(PlacedRobot(turtle, BUILT_IN, model, data), slice(0, 1))
    work, speed, angle, torques = 0.0, 0.0, 0.0, []
    for _ in range(20):
        mujoco.mj_step(model, data)
        probe.add_work()
        probe.read()
        now, place = float(data.qvel[6]), float(data.qpos[7])
        torque = 0.005 * (now - speed) / 0.005
        work += abs(torque * (place - angle))
        speed, angle = now, place
        torques.append(torque)
        assert probe.numbers[1] == pytest.approx(torque, rel=1e-6, abs=1e-12)
    assert probe.numbers[0] == pytest.approx(work, rel=1e-6)
    assert max(torques) <= limit * (1 + 1e-9)
    kinetic = 0.5 * 0.005 * speed * speed
    assert kinetic < work < 1.6 * kinetic


def test_contacts_are_those_with_the_ground_alone(
    turtle: Robot, everything: EvaluationSettings
) -> None:
    """In the air no part touches anything; at rest some part touches the ground."""
    high = replace(everything, simulation=replace(CLOCK, drop_m=20.0))
    assert not simulate(turtle, high).contact.any()
    assert simulate(turtle, everything).contact[-1].any()


def test_objects_out_of_reach_change_no_channel(
    turtle: Robot, everything: EvaluationSettings
) -> None:
    """A ball that moves freely, 20 m away."""
    ball = '<geom type="sphere" size="0.1"/>'
    body = f'<body pos="20 0 0.1"><freejoint/>{ball}</body>'
    light = (1.0, 2.0, 3.0)
    world = Environment(
        scenery=f"<mujoco><worldbody>{body}</worldbody></mujoco>", light=light
    )
    plain = simulate(turtle, everything)
    found = simulate(turtle, replace(everything, environment=world))
    assert found.light == light
    assert found.mass == plain.mass
    for name in RECORDED:
        # The first part of a second: chaos has not yet magnified rounding.
        expected, got = plain.channels[name][:3], found.channels[name][:3]
        assert got.shape == expected.shape
        np.testing.assert_allclose(got, expected, rtol=1e-3, atol=1e-3, err_msg=name)
