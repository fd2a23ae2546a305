"""The control loop, tick by tick: equal to an evaluation, and driven by actions."""

from collections.abc import Callable
from hashlib import sha256

import numpy as np
import pytest
from msgspec.structs import replace

from schema.experiment.document import Measures, Simulation
from schema.experiment.environment import Environment
from schema.experiment.robust import Calibration, Response
from schema.experiment.settings import Ablation, EvaluationSettings
from schema.robot.robot import Robot
from schema.robot.trace import Trace
from tests.worker.evaluations import IDENTITY, with_simulation
from worker.robot.control_loop import ControlLoop
from worker.robot.evaluation import simulate

PLAIN = with_simulation(Simulation(window_steps=480, pose_steps=32, warmup_steps=7))
LOUD = replace(PLAIN.simulation, sensor_noise=0.2, actuator_noise=0.05)
MEASURED = replace(PLAIN, measures=Measures(names=("energy", "contact_share")))
MOTOR = Response(gain=0.8, offset=0.05, delay_s=0.25, noise=0.1)
SENSOR = Response(gain=1.1, delay_s=0.125)
FILTERED = replace(
    MEASURED,
    simulation=LOUD,
    environment=Environment(push_impulse=0.03, push_interval_s=0.5),
    calibration=(
        Calibration(part="ActiveHinge", motor=MOTOR),
        Calibration(part="Core", sensor=SENSOR),
    ),
    ablation=Ablation(inputs=((0, 1.5),), motors=(0,)),
)


def digest(trace: Trace) -> str:
    arrays = (trace.core_position, *trace.channels.values())
    kept = [each.tobytes() for each in arrays if isinstance(each, np.ndarray)]
    return sha256(b"".join(kept)).hexdigest()


@pytest.mark.parametrize("settings", [PLAIN, MEASURED, FILTERED])
def test_evaluation_is_the_loop_to_the_last_bit(
    robot_of: Callable[[int], Robot], settings: EvaluationSettings
) -> None:
    """Observations between the ticks change nothing."""
    for seed in range(3):
        expected = digest(simulate(robot_of(seed), settings, identity=IDENTITY))
        loop = ControlLoop(robot_of(seed), settings, IDENTITY)
        while not loop.done:
            assert loop.observe() is loop.observe()
            loop.step()
        assert digest(loop.trace()) == expected


def test_each_filter_changes_the_motion(turtle: Robot) -> None:
    plain = replace(FILTERED, calibration=(), ablation=None, environment=Environment())
    kinds = {
        digest(simulate(turtle, each, identity=IDENTITY))
        for each in (
            FILTERED,
            replace(FILTERED, calibration=()),
            replace(FILTERED, ablation=None),
            replace(FILTERED, environment=Environment()),
            plain,
            replace(plain, simulation=PLAIN.simulation),
        )
    }
    assert len(kinds) == 6


def test_outputs_of_the_brain_as_actions_change_nothing(turtle: Robot) -> None:
    """Filters act on actions as on the robot's own brain."""
    settings = replace(FILTERED, record=("outputs",))
    expected = simulate(turtle, settings, identity=IDENTITY)
    loop, teacher = (ControlLoop(turtle, settings, IDENTITY) for _ in range(2))
    while not loop.done:
        teacher.step()
        loop.step(2.0 * teacher._outputs[0, :2] - 1.0)
    assert np.allclose(loop.trace().outputs, expected.outputs, atol=1e-9)
    assert np.allclose(loop.trace().core_position, expected.core_position, atol=1e-6)


def test_robot_starts_at_a_place_on_the_ground(turtle: Robot) -> None:
    hills = replace(PLAIN, environment=Environment(roughness_m=0.05, ground_seed=3))
    places = (0.0, 0.0), (1.0, -0.5)
    for settings, is_even in ((PLAIN, True), (hills, False)):
        starts = [ControlLoop(turtle, settings, place=at).data.qpos for at in places]
        assert starts[1][:2].tolist() == [1.0, -0.5]
        assert bool(starts[0][2] == starts[1][2]) == is_even


def test_actions_replace_the_brain(turtle: Robot) -> None:
    """-1 and 1 are the ends of a joint's range, 0 its middle."""
    angles = []
    for action in (-1.0, 0.0, 1.0):
        loop = ControlLoop(turtle, PLAIN)
        while not loop.done:
            assert loop.observe().shape == (1, 8)
            loop.step(np.full(2, action))
        assert loop.now == PLAIN.simulation.evaluation_steps
        angles.append(loop.data.qpos[7])
    assert angles[0] < -0.3
    assert abs(angles[1]) < 0.05
    assert angles[2] > 0.3
