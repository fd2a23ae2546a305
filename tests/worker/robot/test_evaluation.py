"""Off-line evaluation of one robot."""

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import msgspec
import pytest
from msgspec.structs import replace

from schema.errors import ExperimentError, FitnessUndefined, SimulationDiverged
from schema.experiment.document import Fitness, Simulation, Space
from schema.plugins.protocols import FitnessFunction
from schema.robot.ids import NOBODY
from schema.robot.robot import Part, Robot
from schema.robot.trace import Trace
from schema.wire.messages import Evaluate, Request
from tests.schema import robots
from tests.worker.evaluations import bits, with_simulation
from worker.fitness import (
    Functions,
    TraceFunction,
    path_velocity,
    straight_velocity,
)
from worker.robot import evaluation
from worker.robot.evaluation import evaluate, simulate
from worker.serve.jobs import answer_evaluation

RobotOf = Callable[[int], Robot]
WORLD = Simulation()


SETTINGS = with_simulation(WORLD)


def test_evaluation_has_the_fitness_of_the_track(turtle: Robot) -> None:
    track = simulate(turtle, SETTINGS)
    found = evaluate(turtle, SETTINGS)
    assert found.path_velocity == path_velocity(track) > 0
    assert found.straight_velocity == straight_velocity(track) > 0
    assert found.fitness == found.path_velocity + 5 * found.straight_velocity
    assert found.simulated_s == 12.0


def test_track_includes_both_ends_of_its_window(turtle: Robot) -> None:
    track = simulate(turtle, SETTINGS)
    assert track.core_position.shape == (61, 3)
    assert track.interval_s == 0.2
    assert track.core_position[0] == pytest.approx([0, 0, 0.0225], abs=1e-12)


def test_window_starts_after_the_warm_up(turtle: Robot) -> None:
    """The warm-up does not shorten the window."""
    whole = simulate(turtle, with_simulation(replace(WORLD, window_steps=2400 + 600)))
    late = simulate(turtle, with_simulation(replace(WORLD, warmup_steps=600)))
    assert late.core_position.shape == (61, 3)
    assert late.core_position.tobytes() == whole.core_position[15:].tobytes()


def test_sampling_interval_does_not_change_the_motion(turtle: Robot) -> None:
    """Intervals need not divide each other."""
    coarse = simulate(turtle, with_simulation(replace(WORLD, pose_steps=2400)))
    fine = simulate(turtle, with_simulation(replace(WORLD, pose_steps=32)))
    assert coarse.core_position[-1].tobytes() == fine.core_position[-1].tobytes()


def test_robot_without_a_brain_stays_at_its_place() -> None:
    assert evaluate(robots.robot_of(), SETTINGS).fitness < 1e-4


def test_simulation_is_independent_of_threads(robot_of: RobotOf) -> None:
    chosen = [robot_of(seed) for seed in range(8)]
    alone = [bits(simulate(robot, SETTINGS)) for robot in chosen]
    with ThreadPoolExecutor(4) as pool:
        found = list(pool.map(lambda r: bits(simulate(r, SETTINGS)), chosen))
    assert found == alone


def test_divergence_is_reported_with_reason_and_time(
    robot_of: RobotOf,
    capfd: pytest.CaptureFixture[str],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """The engine writes neither to the terminal nor to a file."""
    monkeypatch.chdir(tmp_path)
    absurd = replace(
        WORLD, timestep_s=0.5, servo_armature=0.0, armature=0.0, servo_stiffness=1e9
    )
    with pytest.raises(SimulationDiverged, match=r"diverged by \d+\.\d{3} s: .*BADQ"):
        simulate(robot_of(3), with_simulation(absurd))
    assert capfd.readouterr() == ("", "")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("memory", "message"),
    [
        (1 << 9, "cannot be built: .*out of memory"),
        (1 << 12, r"physics diverged by 0\.060 s: .*out of memory"),
    ],
)
def test_engine_failure_is_reported_as_divergence(
    turtle: Robot, monkeypatch: pytest.MonkeyPatch, memory: int, message: str
) -> None:
    """Too many contacts for the engine's memory; the message has one line."""
    before = bits(simulate(turtle, SETTINGS))
    with monkeypatch.context() as patch:
        patch.setattr("schema.mjcf.model.MEMORY_BYTES", memory)
        with pytest.raises(SimulationDiverged, match=message) as caught:
            simulate(turtle, SETTINGS)
    assert "\n" not in str(caught.value)
    assert bits(simulate(turtle, SETTINGS)) == before


def test_light_sensor_in_a_world_without_light_is_rejected() -> None:
    robot = robots.robot_of(Part("LightSensor", 0, 2, 0, 0, robots.GREY))
    space = Space(part_types=("schema.parts:CORE", "schema.parts:LIGHT_SENSOR"))
    with pytest.raises(ExperimentError, match="no light in this world"):
        simulate(robot, replace(SETTINGS, space=space))


def test_limits_of_a_search_refuse_no_robot_that_exists(turtle: Robot) -> None:
    """It has 8 inputs, and lives as with limits that are just met."""
    brain = turtle.brain
    met = Space(
        max_inputs=8,
        max_outputs=brain.count("output"),
        max_hidden=brain.count("hidden"),
    )
    tight = replace(met, max_parts=2, max_inputs=6, max_outputs=1, max_hidden=0)
    expected, found = (
        simulate(turtle, replace(SETTINGS, space=space)) for space in (met, tight)
    )
    assert brain.count("input") == 8
    assert bits(found) == bits(expected)


def not_a_number(_track: Trace, _fitness: Fitness) -> float:
    return float("nan")


def raises(_track: Trace, _fitness: Fitness) -> float:
    raise ZeroDivisionError("by nothing")


@pytest.mark.parametrize(
    ("function", "message"),
    [
        (not_a_number, "must return a finite number, got nan"),
        (raises, "raised ZeroDivisionError: by nothing"),
    ],
)
def test_undefined_fitness_is_a_result(
    turtle: Robot,
    monkeypatch: pytest.MonkeyPatch,
    function: FitnessFunction,
    message: str,
) -> None:
    named = Functions(TraceFunction("own:function", function, (None,)), (), ())
    monkeypatch.setattr(evaluation, "functions_of", lambda _settings: named)
    with pytest.raises(FitnessUndefined, match=message):
        evaluate(turtle, SETTINGS)
    work = Evaluate(NOBODY, turtle)
    request = Request("run", 1, 2, work, msgspec.json.encode(SETTINGS))
    assert message in str(answer_evaluation(request, work))
