"""Sensors of a user's module, alone and in an arena."""

import math
import sys
from collections.abc import Callable
from pathlib import Path

import mujoco
import numpy as np
import pytest
from msgspec.structs import replace

from schema.errors import SensorFailed
from schema.experiment.document import Simulation, Space, body_space
from schema.experiment.settings import ArenaSettings, EvaluationSettings
from schema.mjcf.model import solo_spec
from schema.plugins.permission import allow
from schema.robot.brain import INPUT, Brain, Connection, Neuron
from schema.robot.ids import BirthId
from schema.robot.robot import Part, Robot
from schema.wire.arena import Changes, Insertion
from tests.worker.arena_cases import populated, seconds, settings_of, state_of
from tests.worker.evaluations import with_simulation
from worker.arena.world import World
from worker.robot.devices import Sensors
from worker.robot.evaluation import evaluate, simulate
from worker.robot.own_sensors import Surroundings
from worker.robot.placed import PlacedRobot

GREY = (0.5, 0.5, 0.5)
A, B, C = BirthId(0, 1), BirthId(0, 2), BirthId(0, 3)
RADIUS = 0.05
WIDTH = 20


@pytest.fixture(autouse=True)
def _plugins() -> None:
    allow([str(Path(__file__).parents[2] / "plugins" / "crawlers.py")])


def space_of(piston: str) -> Space:
    """Return a space with one of the pistons, wheels and infrared sensors."""
    return Space(
        part_types=(
            *Space().part_types,
            f"crawlers:{piston}",
            "schema.robogen_parts:ACTIVE_WHEEL",
            "schema.robogen_parts:IR_SENSOR",
        ),
        max_inputs=WIDTH,
    )


def arena(piston: str = "PISTON", **keys: object) -> ArenaSettings:
    """Return arena settings with a piston."""
    return replace(settings_of(drop_m=0.0, **keys), space=space_of(piston))


def offline(piston: str = "PISTON") -> EvaluationSettings:
    """Return evaluation settings with a piston."""
    return with_simulation(Simulation(), space=space_of(piston))


def crawler() -> Robot:
    """Return a core with piston and infrared sensor ahead (+x), wheel at its side.

    The piston swings with an oscillator and with what its sensor reads.
    """
    parts = (
        Part("Core", -1, -1, -1, 0, GREY),
        Part("ActiveWheel", 0, 1, 0, 0, (1000 * RADIUS, *GREY)),
        Part("Piston", 0, 2, 0, 0, GREY),
        Part("IrSensor", 0, 3, 0, 0, GREY),
    )
    inputs = [0] * 6 + [2] * 3 + [3]
    neurons = (
        *(Neuron("input", INPUT, part) for part in inputs),
        Neuron("output", "Simple", 1, (0.0, 1.0)),
        Neuron("output", "Sigmoid", 2, (0.0, 1.0)),
        Neuron("hidden", "Oscillator", 2, (1.5, 0.0, 1.0)),
    )
    edges = (
        Connection(6, 11, 0.5),
        Connection(7, 11, 0.3),
        Connection(9, 10, 0.7),
        Connection(12, 11, 2.0),
        Connection(12, 10, 0.4),
    )
    return Robot(parts, Brain(neurons, edges))


def readings(world: World, birth: BirthId) -> list[float]:
    """Return a robot's readings of its own sensors: feeler (3), infrared."""
    found: list[float] = world.population.find(birth).view.sensors.readings[0].tolist()
    return found[6:10]


# --- by hand -----------------------------------------------------------------


def test_readings_of_two_robots_face_to_face() -> None:
    """The pistons' rods end 45 + 70 mm ahead of the cores.

    Cores 0.4 m apart and one turned by a half: 0.4 - 2 * 0.115 = 0.17 m are left. The
    infrared sensors look the other way and see nothing.
    """
    newborns = [
        Insertion(A, crawler(), (0.0, 0.0), 0.0),
        Insertion(B, crawler(), (0.4, 0.0), math.pi),
    ]
    world = populated(arena(), newborns)
    expected = [1.0 - (0.17 - 0.0001) / 0.3, 0.0, 1.0, 0.0]
    for birth in (A, B):
        assert readings(world, birth) == pytest.approx(expected, abs=1e-6)


@pytest.mark.parametrize(
    ("place", "heading", "expected"),
    [((-0.3, 0.0), 0.0, 1 - (0.3 - 0.045 - 0.007 - 0.115) / 0.5), ((-1.0, 0.0), 0, 0)],
)
def test_infrared_sees_the_nearest_robot_within_half_a_metre(
    place: tuple[float, float], heading: float, expected: float
) -> None:
    """The sensor's ray starts 6.75 mm from the face of the core, at x = -45 mm."""
    other = Insertion(B, crawler(), place, heading)
    world = populated(arena(), [Insertion(A, crawler(), (0.0, 0.0)), other])
    found = readings(world, A)[3]
    assert found == pytest.approx(expected, abs=1e-3)
    assert (found > 0.0) is (expected > 0.0)


def test_rays_pass_through_their_own_segment_and_end_at_the_ground() -> None:
    """At rest the core's centre is 50 mm high, the radius of the wheel."""
    settings = offline()
    robot, types = crawler(), body_space(settings.space)
    model = solo_spec(robot, types, settings.simulation, settings.environment).compile()
    data = mujoco.MjData(model)
    sensors = Sensors(PlacedRobot(robot, types, model, data), width=WIDTH)
    sensors.start()
    assert sensors.own is not None
    view = sensors.own._sensors[0][0]
    view.around = Surroundings(1.5, sensors.touching())
    assert view.age_s == 1.5
    assert view.others.shape == (0, 3)
    assert view.light is None
    assert view.position("barrel") == pytest.approx([0.06, 0.0, RADIUS])
    assert view.rotation("barrel") == pytest.approx(np.eye(3), abs=1e-12)
    assert view.rotation("rod")[:, 2] == pytest.approx([1.0, 0.0, 0.0], abs=1e-12)
    down = (0.0, 0.0, -1.0)
    assert view.distance("barrel", down, 1.0) == pytest.approx(RADIUS)
    assert view.distance("barrel", down, 0.02) == 0.02
    assert view.distance("barrel", (0.0, 0.0, 1.0), 3.0) == 3.0
    # Ahead of the barrel's centre is its rod, another segment, 15 mm away; behind it
    # is the core, of the same segment.
    assert view.distance("barrel", (1.0, 0.0, 0.0), 1.0) == pytest.approx(0.015)
    assert view.distance("barrel", (-1.0, 0.0, 0.0), 1.0) == 1.0
    data.joint("joint2").qpos, data.joint("joint2").qvel = 0.01, -0.2
    mujoco.mj_kinematics(model, data)
    assert (view.joint_angle, view.joint_speed) == (0.01, -0.2)
    assert view.distance("barrel", (1.0, 0.0, 0.0), 1.0) == pytest.approx(0.025)
    assert not view.touches("rod")
    with pytest.raises(KeyError):
        view.position("wheel")


def test_contacts_of_a_box_are_seen() -> None:
    world = populated(arena(), [Insertion(A, crawler(), (0.0, 0.0))])
    wheel, rod = (
        world.population.find(A).view.model.geom(name).id
        for name in ("1/wheel", "2/rod")
    )
    seconds(world, 0.25)
    assert wheel in world.population.cluster_of[A].touched
    touched = rod in world.population.cluster_of[A].touched
    assert (readings(world, A)[0] >= 1.0) is touched


# --- both paths --------------------------------------------------------------


def test_readings_alone_equal_those_in_an_arena_for_the_same_state() -> None:
    """To the last bit, at many states, with no other robot within reach."""
    newborns = [
        Insertion(A, crawler(), (0.0, 0.0)),
        Insertion(B, crawler(), (30.0, 0.0)),
    ]
    world = populated(arena(), newborns)
    settings = offline()
    robot, types = crawler(), body_space(settings.space)
    clock = settings.simulation
    model = solo_spec(robot, types, clock, settings.environment).compile()
    data = mujoco.MjData(model)
    sensors = Sensors(PlacedRobot(robot, types, model, data), width=WIDTH)
    for _ in range(24):
        # Up to the tick, whose readings belong to the state just reached.
        seconds(world, 0.125)
        view = world.population.find(A).view
        data.qpos[:], data.qvel[:] = view.qpos, view.qvel
        mujoco.mj_kinematics(model, data)
        cluster = world.population.cluster_of[A]
        around = Surroundings(
            world.step * clock.timestep_s, cluster.touched, others=np.full((1, 3), 30.0)
        )
        assert sensors.own is not None
        sensors.own.read(sensors.readings[0], around)
        expected = view.sensors.readings[0, 6:10]
        assert sensors.readings[0, 6:10].tobytes() == expected.tobytes()
        assert abs(expected[1]) <= 1.1
    assert expected[1] != 0.0


def test_readings_do_not_depend_on_clusters_or_threads(turtle: Robot) -> None:
    """Robots near each other; one thread or two; alone or after a restore."""
    newborns = [
        Insertion(BirthId(0, n), crawler() if n % 2 else turtle, (0.3 * n, 0.02 * n))
        for n in range(6)
    ]
    settings = arena()
    world, threaded = populated(settings, newborns), populated(settings, newborns, 2)
    seconds(world, 1.0)
    seconds(threaded, 0.5)
    restored = World.restore(settings, threaded.snapshot())
    seconds(restored, 0.5)
    assert any(len(each.members) > 1 for each in world.population.clusters)
    for birth in world.births:
        assert state_of(world, birth) == state_of(restored, birth)
    assert world.digest() == restored.digest()


def test_an_evaluation_uses_own_sensors_and_repeats() -> None:
    settings = offline()
    first, second = simulate(crawler(), settings), simulate(crawler(), settings)
    assert first.core_position.tobytes() == second.core_position.tobytes()
    deaf = Robot(crawler().parts, Brain(crawler().brain.neurons))
    other = simulate(deaf, settings)
    assert other.core_position.tobytes() != first.core_position.tobytes()


# --- failures ----------------------------------------------------------------

REASON = (
    r"sensor Fragile of part 2 \(Piston\): ValueError: must return finite numbers, "
    r"got \[nan, .*\]"
)


def test_a_failed_sensor_is_a_failed_evaluation() -> None:
    with pytest.raises(SensorFailed, match=REASON):
        evaluate(crawler(), offline("FRAGILE"))


def test_a_failed_sensor_removes_its_robot_only(
    robot_of: Callable[[int], Robot],
) -> None:
    others = [Insertion(BirthId(0, n), robot_of(n), (0.35 * n, 1.0)) for n in (7, 8)]
    world = populated(arena("FRAGILE"), [*others, Insertion(A, crawler(), (0.0, 0.0))])
    assert seconds(world, 2.0).casualties == ()
    [casualty] = seconds(world, 1.0).casualties
    assert casualty.birth == A
    # The first tick of more than 2 s: 17 ticks of 25 steps.
    assert casualty.step == 425
    assert casualty.reason.startswith("sensor Fragile of part 2 (Piston): ValueError")
    assert world.births == (BirthId(0, 7), BirthId(0, 8))
    assert seconds(world, 1.0).casualties == ()


def test_a_sensor_that_fails_at_birth_is_a_casualty_of_the_next_advance(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def fail(_self: object, _view: object) -> list[float]:
        raise OSError("no such whisker")

    settings = arena("FRAGILE")
    world = World(settings)
    monkeypatch.setattr(sys.modules["crawlers"].Fragile, "read", fail)
    newborns = (Insertion(A, crawler(), (0.0, 0.0)), Insertion(B, crawler(), (3.0, 0)))
    world.apply(Changes(insertions=newborns))
    assert world.births == ()
    found = seconds(world, 1.0).casualties
    assert [each.birth for each in found] == [A, B]
    assert {each.step for each in found} == {0}
    reason = "sensor Fragile of part 2 (Piston): OSError: no such whisker"
    assert {each.reason for each in found} == {reason}


def test_a_sensor_that_changes_its_inputs_fails(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    world = populated(arena("FRAGILE"), [Insertion(A, crawler(), (0.0, 0.0))])
    kind = sys.modules["crawlers"].Fragile
    inputs = kind.inputs
    monkeypatch.setattr(kind, "inputs", inputs + 1)
    monkeypatch.setattr(kind, "read", lambda *_: [0.5] * (inputs + 1))
    [casualty] = seconds(world, 1.0).casualties
    assert casualty.reason.endswith(
        f"ValueError: must return {inputs} values, its inputs, got {inputs + 1}"
    )
