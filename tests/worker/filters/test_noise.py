"""Noise depends on identity and tick only."""

from collections.abc import Callable

import mujoco
import numpy as np
import pytest
from msgspec.structs import replace

from schema.experiment.brains import widths
from schema.experiment.document import Simulation, Space
from schema.experiment.identity import NO_IDENTITY, Identity, Origin
from schema.robot.brain import Brain, Connection, Neuron
from schema.robot.ids import BirthId
from schema.robot.robot import Robot
from schema.robot.trace import Floats
from schema.wire.arena import Changes, Insertion
from tests.worker.arena_cases import (
    SETTINGS,
    counted,
    crowd,
    populated,
    seconds,
    settings_of,
    state_of,
)
from tests.worker.evaluations import IDENTITY, ORIGIN, OTHERS, bits, with_simulation
from worker.arena.replay import alone
from worker.arena.world import World
from worker.filters.noise import BLOCK_TICKS, Noise
from worker.robot.devices import HIGHEST_OUTPUT, LOWEST_OUTPUT
from worker.robot.evaluation import evaluate, simulate

Robots = Callable[[int], Robot]
A, B = BirthId(0, 0), BirthId(0, 1)
LOUD = Simulation(sensor_noise=0.3, actuator_noise=0.05, window_steps=800)
NOISY = replace(
    settings_of(record_touches=True),
    simulation=replace(
        SETTINGS.simulation, sensor_noise=0.3, actuator_noise=0.05, window_steps=800
    ),
    origin=ORIGIN,
)
WIDTH = widths(Space())


def noise_of(
    *births: BirthId, simulation: Simulation = LOUD, identity: Identity = IDENTITY
) -> Noise:
    return Noise(simulation, WIDTH, identity.origin, births, identity.trial)


def drawn(identity: Identity, ticks: int = 200) -> Floats:
    """Return the noise on a robot's readings and outputs, (T, I + O)."""
    noise = noise_of(identity.birth, identity=identity)
    zeros = np.zeros((1, WIDTH.inputs)), np.zeros((1, WIDTH.outputs))
    return np.array(
        [
            np.hstack(
                [noise.readings(tick, zeros[0])[0], noise.outputs(tick, zeros[1])[0]]
            )
            for tick in range(ticks)
        ]
    )


def test_noise_has_mean_zero_and_the_configured_deviation() -> None:
    found = drawn(IDENTITY, 5000)
    for part, sd in ((found[:, :10], 0.3), (found[:, 10:], 0.05)):
        # 50000 draws: three standard errors.
        assert abs(part.mean()) < 3 * sd / np.sqrt(part.size)
        assert part.std() == pytest.approx(sd, rel=3 / np.sqrt(2 * part.size))
        # A tenth lies beyond 1.645 deviations of a normal distribution.
        assert np.mean(np.abs(part) > 1.645 * sd) == pytest.approx(0.1, abs=0.005)
    ticks = np.corrcoef(found[:-1].ravel(), found[1:].ravel())[0, 1]
    neurons = np.corrcoef(found[:, :-1].ravel(), found[:, 1:].ravel())[0, 1]
    assert max(abs(ticks), abs(neurons)) < 3 / np.sqrt(found.size)


def test_noise_is_independent_of_other_robots_and_order_of_ticks() -> None:
    births = [BirthId(2, 5), BirthId(0, 1), BirthId(2, 4)]
    readings = np.linspace(-1.0, 1.0, 3 * WIDTH.inputs).reshape(3, -1)
    population, own = noise_of(*births), [noise_of(birth) for birth in births]
    ticks = [0, BLOCK_TICKS - 1, BLOCK_TICKS, 5 * BLOCK_TICKS + 3, 1, 0]
    for tick in ticks:
        whole = population.readings(tick, readings)
        for row, noise in enumerate(own):
            single = noise.readings(tick, readings[row : row + 1])
            assert np.array_equal(whole[row : row + 1], single)
    assert not np.array_equal(
        population.readings(0, readings), population.readings(64, readings)
    )


def test_sensor_and_actuator_noise_are_independent() -> None:
    rows = np.ones((1, 10))
    both = noise_of(A)
    sensors = noise_of(A, simulation=replace(LOUD, actuator_noise=0.0))
    actuators = noise_of(A, simulation=replace(LOUD, sensor_noise=0.0))
    assert np.array_equal(sensors.readings(3, rows), both.readings(3, rows))
    assert np.array_equal(actuators.outputs(3, rows), both.outputs(3, rows))
    assert sensors.outputs(3, rows) is rows
    assert actuators.readings(3, rows) is rows


# --- off-line ---------------------------------------------------------------------


def test_evaluations_of_one_identity_are_equal_and_others_differ(
    robot_of: Robots,
) -> None:
    settings = with_simulation(LOUD)
    robot = robot_of(3)
    found = evaluate(robot, settings, IDENTITY)
    assert evaluate(robot, settings, IDENTITY) == found
    fitness = {evaluate(robot, settings, other).fitness for other in OTHERS}
    assert len(fitness | {found.fitness}) == 1 + len(OTHERS)
    repeated, poses = alone(robot, settings, IDENTITY)
    assert repeated == found
    assert set(poses["birth"].to_pylist()) == {5}
    other, moved = alone(robot, settings, OTHERS[-1])
    assert other != found
    assert moved["x"][-1] != poses["x"][-1]


def test_without_noise_the_identity_has_no_effect(robot_of: Robots) -> None:
    """No random number is drawn: the generator is disabled."""
    silent = replace(LOUD, sensor_noise=0.0, actuator_noise=0.0)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(np.random, "Philox", None)
        found = {
            bits(simulate(robot_of(3), with_simulation(silent), identity=identity))
            for identity in (NO_IDENTITY, IDENTITY, *OTHERS)
        }
    assert len(found) == 1


def test_sensor_noise_affects_only_robots_that_use_their_sensors(turtle: Robot) -> None:
    """The turtle's motors follow oscillators; connected to its imu, they do not."""
    still = replace(LOUD, sensor_noise=0.0, actuator_noise=0.0)
    sensor_noise = replace(LOUD, actuator_noise=0.0)
    plain = bits(simulate(turtle, with_simulation(still)))
    assert (
        bits(simulate(turtle, with_simulation(sensor_noise), identity=IDENTITY))
        == plain
    )
    connected = wired(turtle, [(0, 0.1)])
    assert bits(
        simulate(connected, with_simulation(sensor_noise), identity=IDENTITY)
    ) != bits(simulate(connected, with_simulation(still)))


def wired(turtle: Robot, edges: list[tuple[int, float]]) -> Robot:
    """Return a turtle whose outputs are 0.5 plus its (input, weight) edges."""
    inputs = turtle.brain.neurons[:8]
    motors = [Neuron("output", "Simple", part, (-0.5, 1.0)) for part in (1, 3)]
    wires = [
        Connection(source, target, weight)
        for source, weight in edges
        for target in (8, 9)
    ]
    return Robot(turtle.parts, Brain((*inputs, *motors), tuple(wires)))


def shares(robot: Robot, simulation: Simulation) -> Floats:
    """Return each joint's target as a share of its range, (T, 2)."""
    found: list[Floats] = []

    def watch(data: mujoco.MjData) -> None:
        # ctrl = gain (low + share span - angle), 0.9 and from -45 to 45 degrees.
        target = data.ctrl / 0.9 + data.qpos[7:]
        found.append((target + np.pi / 4) / (np.pi / 2))

    simulate(robot, with_simulation(simulation), identity=IDENTITY, watch=watch)
    return np.array(found)


def test_motor_targets_have_the_configured_deviation(turtle: Robot) -> None:
    world = Simulation(window_steps=8000, actuator_noise=0.05)
    found = shares(wired(turtle, []), world) - 0.5
    assert found.shape == (320, 2)
    assert found.std() == pytest.approx(0.05, rel=3 / np.sqrt(2 * found.size))
    assert abs(found.mean()) < 3 * 0.05 / np.sqrt(found.size)


def test_network_inputs_have_the_configured_deviation(turtle: Robot) -> None:
    """Both pads of the turtle are in the air and read 0 plus noise."""
    world = Simulation(window_steps=8000, sensor_noise=0.2)
    found = shares(wired(turtle, [(6, 0.25), (7, 0.0)]), world) - 0.5
    assert np.allclose(found[:, 0], found[:, 1])
    assert found.std() == pytest.approx(0.05, rel=3 / np.sqrt(len(found)))
    assert abs(found.mean()) < 3 * 0.05 / np.sqrt(len(found))


def test_outputs_are_clipped_after_the_noise(turtle: Robot) -> None:
    found = shares(wired(turtle, []), replace(LOUD, actuator_noise=1e6))
    assert found.min() == pytest.approx(LOWEST_OUTPUT, abs=1e-9)
    assert found.max() == pytest.approx(HIGHEST_OUTPUT, abs=1e-9)


# --- arenas -----------------------------------------------------------------------


def test_noise_of_a_robot_alone_equals_that_off_line(robot_of: Robots) -> None:
    """Noise of one identity is equal from step 0 on, to the last bit."""
    for seed in (3, 4):
        world = populated(NOISY, [Insertion(A, robot_of(seed), (0.0, 0.0))])
        world.advance(600 + 800)
        simulation = replace(NOISY.simulation, drop_m=NOISY.arena.drop_m)
        identity = Identity(ORIGIN, A, 0)
        track = simulate(robot_of(seed), with_simulation(simulation), identity=identity)
        own = np.array(world.population.find(A).window.positions)
        assert np.array_equal(own, track.core_position)
        calm = simulate(robot_of(seed), with_simulation(SETTINGS.simulation))
        assert not np.array_equal(own, calm.core_position[: len(own)])


def test_distant_births_and_deaths_do_not_change_the_noise(robot_of: Robots) -> None:
    """Other robots have smaller and greater birth numbers."""
    own = Insertion(BirthId(0, 5), robot_of(3), (0.0, 0.0))
    lonely, busy = populated(NOISY, [own]), populated(NOISY, [own])
    seconds(lonely, 3.0)
    for turn in range(3):
        others = [
            Insertion(BirthId(0, number), robot_of(number), (5.0, 0.2 * number))
            for number in (2 * turn + 10, 4 - turn)
        ]
        gone = tuple(birth for birth in busy.births if birth != own.birth)
        busy.apply(Changes(gone, tuple(others)))
        seconds(busy, 1.0)
    assert state_of(lonely, own.birth) == state_of(busy, own.birth)


def test_noise_starts_with_the_first_tick_of_a_newborn(turtle: Robot) -> None:
    held = [
        populated(settings, [Insertion(A, wired(turtle, []), (0.0, 0.0))])
        for settings in (NOISY, NOISY, replace(NOISY, origin=Origin(seed=8)))
    ]
    first, same, other = (world.population.find(A).view.ctrl.copy() for world in held)
    assert np.array_equal(first, same)
    assert not np.array_equal(first, other)


def lived(world: World, robot_of: Robots) -> list[bytes]:
    """Return digests of a world with births, deaths and merges."""
    digests = [seconds(world, 1.0).digest]
    world.apply(Changes(world.births[:2], crowd(robot_of, 2, 0.3, seed=2, first=20)))
    return [*digests, seconds(world, 1.0).digest]


def test_noise_is_independent_of_threads_advances_and_restores(
    robot_of: Robots,
) -> None:
    newborns = crowd(robot_of, 8, 0.4)
    plain, regrouped = counted(NOISY, newborns)
    expected = lived(plain, robot_of)
    assert regrouped.merges > 0
    threaded = populated(NOISY, newborns, threads=2)
    assert lived(threaded, robot_of) == expected
    threaded.close()
    pieces = populated(NOISY, newborns)
    for until in (1, 13, 77, 130, 199):
        pieces.advance(until)
        pieces = World.restore(NOISY, pieces.snapshot(), threads=2)
    pieces.advance(200)
    assert pieces.digest() == expected[0]
    pieces.close()
