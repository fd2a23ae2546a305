"""Held inputs and dead motors, on robots whose fitness one of them must carry."""

from collections.abc import Callable

import pytest
from msgspec.structs import replace

from schema.errors import InvalidRobot
from schema.experiment.document import Measures, Simulation, Space, body_space
from schema.experiment.identity import Identity, Origin
from schema.experiment.settings import Ablation, EvaluationSettings
from schema.robot.brain import Brain, Connection, Neuron
from schema.robot.ids import BirthId
from schema.robot.robot import Part, Robot
from schema.robot.trace import Trace, needs
from tests.schema import robots
from tests.worker.evaluations import with_simulation
from worker.filters.channels import all_ablations
from worker.robot.evaluation import evaluate, mean_inputs, simulate

TICK_STEPS = 25
SETTINGS = with_simulation(Simulation(window_steps=1200, warmup_steps=400))
LEG = robots.robot_of(
    Part("ActiveHinge", 0, 2, 0, 0, robots.GREY),
    Part("FixedBrick", 1, 1, 0, 0, robots.GREY),
    Part("TouchSensor", 2, 1, 0, 0, robots.GREY),
)
INPUTS = LEG.brain.neurons[:8]
LEFT, RIGHT, MOTOR = 6, 7, 8
REFLEX = Robot(
    LEG.parts,
    Brain(
        (*INPUTS, Neuron("output", "Simple", 1, (0.0, 1.0))),
        (Connection(LEFT, MOTOR, 1.0),),
    ),
)
"""A leg that lifts while its left pad touches: the pad makes it move."""
CLOCK = Robot(
    LEG.parts,
    Brain(
        (*INPUTS, Neuron("output", "Oscillator", 1, (1.0, 0.0, 1.0))),
        (Connection(LEFT, MOTOR, 1.0), Connection(RIGHT, MOTOR, 1.0)),
    ),
)
"""The same leg, moved by an oscillator, which ignores its pads."""


def fitness(robot: Robot, *, settings: EvaluationSettings = SETTINGS) -> float:
    return evaluate(robot, settings).fitness


def without(robot: Robot, ablation: Ablation) -> float:
    return fitness(robot, settings=replace(SETTINGS, ablation=ablation))


def held(*inputs: int, at: float | None = 0.0) -> Ablation:
    return Ablation(inputs=tuple((number, at) for number in inputs))


def test_a_sensor_that_carries_the_fitness() -> None:
    whole = fitness(REFLEX)
    # What is left is the fall at the start.
    assert without(REFLEX, held(LEFT)) < 0.2 * whole
    assert without(REFLEX, held(LEFT, at=None)) < 0.1 * whole
    others = [number for number in range(8) if number != LEFT]
    assert without(REFLEX, held(*others)) == whole
    assert without(REFLEX, held(*others, at=None)) == whole


def test_a_brain_that_ignores_its_sensors_keeps_all() -> None:
    assert without(CLOCK, held(*range(8))) == fitness(CLOCK)
    assert without(CLOCK, held(*range(8), at=None)) == fitness(CLOCK)


@pytest.mark.parametrize("robot", [REFLEX, CLOCK])
def test_the_only_motor_carries_the_fitness(robot: Robot) -> None:
    assert without(robot, Ablation(motors=(0,))) < 0.002 * fitness(robot)


def test_the_brain_runs_on_behind_a_dead_motor(turtle: Robot) -> None:
    """The second motor repeats the first one, which is dead or has an amplitude of 0.

    A neuron that stands still stops both motors; a dead motor stops only its own.
    """
    brain = turtle.brain
    *inputs, first, second = brain.neurons
    follower = replace(second, kind="Simple", parameters=(0.0, 1.0))
    edges = (Connection(8, 9, 1.0),)
    robot = Robot(turtle.parts, Brain((*inputs, first, follower), edges))
    still = replace(first, parameters=(1.5, 0.0, 0.0))
    stopped = Robot(turtle.parts, Brain((*inputs, still, follower), edges))
    dead = Ablation(motors=(0,))
    assert without(robot, dead) > 10 * fitness(stopped)
    # Without the connection, both are the same.
    robot, stopped = (
        Robot(turtle.parts, Brain(each.brain.neurons)) for each in (robot, stopped)
    )
    assert without(robot, dead) == fitness(stopped)


def test_an_input_at_0_is_one_without_connections(
    robot_of: Callable[[int], Robot],
) -> None:
    robot = robot_of(5)
    kept = tuple(e for e in robot.brain.connections if e.source != 2)
    assert len(kept) < len(robot.brain.connections)
    bare = Robot(robot.parts, Brain(robot.brain.neurons, kept))
    assert without(robot, held(2)) == fitness(bare)
    assert without(robot, held(2)) != fitness(robot)


@needs("readings")
def readings(trace: Trace) -> float:
    """Declare the channel."""
    return float(trace.readings[0, 0])


def test_means_are_those_of_all_ticks(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("worker.measures.BUILT_IN", {"readings": readings})
    clock = Simulation(window_steps=1000, pose_steps=TICK_STEPS)
    settings = replace(SETTINGS, simulation=clock)
    recorded = replace(settings, measures=Measures(names=("readings",)))
    rows = simulate(REFLEX, recorded).readings
    # The last sample is at the end of the window, where the brain does not tick.
    assert mean_inputs(REFLEX, settings) == pytest.approx(rows[:-1].mean(axis=0))
    assert rows[:-1, LEFT].any()
    means = mean_inputs(REFLEX, settings)
    by_hand = Ablation(inputs=tuple(enumerate(means)))
    assert fitness(
        REFLEX, settings=replace(settings, ablation=held(*range(8), at=None))
    ) == fitness(REFLEX, settings=replace(settings, ablation=by_hand))


def test_held_inputs_and_dead_motors_have_no_noise() -> None:
    loud = Simulation(window_steps=400, sensor_noise=0.3, actuator_noise=0.3)
    everything = replace(held(*range(8)), motors=(0,))
    settings = replace(SETTINGS, simulation=loud, ablation=everything)
    found = {
        evaluate(REFLEX, settings, Identity(Origin(seed), BirthId(0, 1), 0)).fitness
        for seed in range(3)
    }
    assert len(found) == 1


def test_all_ablations_of_a_robot() -> None:
    found = all_ablations(REFLEX, body_space(Space()))
    names = [(c.group, c.scope, c.kind, c.part, c.channel, c.name) for c in found]
    assert len(names) == 2 * (8 + 2 + 1) + 1 + 1 + 1
    zero = "input at 0"
    assert names[3] == (zero, "one", "imu", 0, 3, "rotation x of part 0")
    assert names[7] == (zero, "one", "touch", 3, 7, "touch right of part 3")
    assert names[8:11] == [
        (zero, "kind", "imu", None, None, "all imu"),
        (zero, "kind", "touch", None, None, "all touch"),
        (zero, "all", "", None, None, "all sensors"),
    ]
    assert found[8].ablation == held(*range(6))
    assert found[9].ablation == held(LEFT, RIGHT)
    assert found[10].ablation == held(*range(8))
    assert found[21].ablation == held(*range(8), at=None)
    assert names[22:] == [
        ("motor dead", "one", "ActiveHinge", 1, 0, "motor of part 1"),
        ("motor dead", "kind", "ActiveHinge", None, None, "all ActiveHinge"),
        ("motor dead", "all", "", None, None, "all motors"),
    ]
    assert {c.ablation.motors for c in found[22:]} == {(0,)}


@pytest.mark.parametrize(
    ("ablation", "message"),
    [
        (held(8), "ablation.inputs: the robot has 8, got number 8"),
        (Ablation(motors=(1,)), "ablation.motors: the robot has 1, got number 1"),
    ],
)
def test_an_ablation_of_another_robot(ablation: Ablation, message: str) -> None:
    with pytest.raises(InvalidRobot, match=message):
        without(REFLEX, ablation)
