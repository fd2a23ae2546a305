"""A world is a pure function of its settings, changes and advances."""

import math
from collections.abc import Callable

import numpy as np
import pytest
from msgspec.structs import replace

from schema.errors import UnexpectedEvent
from schema.experiment.document import Fitness, Space
from schema.experiment.settings import EvaluationSettings
from schema.plugins.protocols import Bank
from schema.robot.brain import Brain, Neuron
from schema.robot.ids import BirthId
from schema.robot.robot import Part, Robot
from schema.robot.trace import Floats
from schema.wire.arena import BrainChange, Changes, Insertion
from schema.wire.poses import PoseArrays
from tests.schema import robots
from tests.worker.arena_cases import (
    EXPERIMENT,
    SECOND,
    SETTINGS,
    crowd,
    placed,
    populated,
    seconds,
    settings_of,
)
from worker.arena.world import World
from worker.robot.brains import Controls, solo_brain
from worker.robot.evaluation import simulate

Robots = Callable[[int], Robot]
A, B = BirthId(0, 0), BirthId(0, 1)
TICK, EXCHANGE = 25, 800
"""Physics steps between two ticks, and before a brain is exchanged."""


def test_result_is_independent_of_the_number_of_advances(robot_of: Robots) -> None:
    newborns = crowd(robot_of, 6, 0.4)
    whole, pieces = populated(SETTINGS, newborns), populated(SETTINGS, newborns)
    once = whole.advance(700)
    for until in (1, 13, 64, 200, 333, 698, 700):
        last = pieces.advance(until)
    assert last.digest == once.digest
    assert last.judgements == once.judgements


def test_invalid_changes_change_nothing(robot_of: Robots) -> None:
    world = populated(SETTINGS, crowd(robot_of, 2, 1.0))
    before = world.digest()
    guest = Insertion(BirthId(0, 9), robot_of(9), (0.0, 0.0))
    wrong = [
        Changes(removals=(BirthId(0, 7),), insertions=(guest,)),
        Changes(insertions=(guest, guest)),
        Changes(insertions=(Insertion(A, robot_of(0), (1.0, 1.0)),)),
        Changes(brains=(BrainChange(BirthId(0, 7), Brain()),)),
        Changes(removals=(A,), brains=(BrainChange(A, robot_of(0).brain),)),
    ]
    for changes in wrong:
        with pytest.raises(UnexpectedEvent):
            world.apply(changes)
        assert world.digest() == before
    world.advance(13)
    with pytest.raises(UnexpectedEvent, match="brain_steps = 25, got step 13"):
        world.apply(Changes(insertions=(guest,)))
    with pytest.raises(UnexpectedEvent, match="until must be > step = 13"):
        world.advance(13)


def test_poses_are_recorded_for_all_robots(turtle: Robot) -> None:
    world = populated(
        SETTINGS,
        [Insertion(A, turtle, (1.0, 2.0), 0.5), Insertion(B, turtle, (9.0, 2.0))],
    )
    advance = world.advance(80)
    rows = PoseArrays.received(advance.poses).rows()
    assert rows["birth"].to_pylist() == [0, 1, 0, 1]
    assert rows["sim_time_s"].to_pylist() == [0.2, 0.2, 0.4, 0.4]
    assert rows["x"].to_pylist() == pytest.approx([1.0, 9.0] * 2, abs=0.01)
    assert rows["qz"][0].as_py() == pytest.approx(math.sin(0.25), abs=0.01)
    assert [len(angles) for angles in rows["angles"].to_pylist()] == [2] * 4
    assert world.poses().rows().equals(rows.slice(2))


def test_replaced_brain_starts_at_rest_with_its_own_clock(turtle: Robot) -> None:
    """Constant outputs move the turtle's joints to constant angles."""
    world = populated(SETTINGS, [Insertion(A, turtle, (0.0, 0.0))])
    seconds(world, 4.0)
    still = Brain(
        tuple(
            Neuron("output", "Simple", neuron.part, (-1.0, 0.5))
            if neuron.layer == "output"
            else neuron
            for neuron in turtle.brain.neurons
        )
    )
    world.apply(Changes(brains=(BrainChange(A, still),)))
    assert not world.population.find(A).states.any()
    copy = World.restore(SETTINGS, world.snapshot())
    seconds(world, 8.0)
    assert np.abs(world.population.find(A).view.qpos[7:]).max() < 0.02
    seconds(copy, 8.0)
    assert copy.digest() == world.digest()


class Switching:
    """Brain that is exchanged by hand: the first one, then another one at rest."""

    def __init__(self, *solos: Bank) -> None:
        self.solos = solos

    def step(self, readings: Floats, age_ticks: float) -> Floats:
        first, second = self.solos
        if age_ticks <= EXCHANGE // TICK:
            return first.step(readings, age_ticks)
        return second.step(readings, age_ticks - EXCHANGE // TICK - 1)


def test_exchanged_brain_moves_a_robot_as_two_brains_by_hand(
    robot_of: Robots, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Bit for bit: brain A to step 800, its last tick; then B at rest from 825 on."""
    robot = robot_of(10)
    neurons = tuple(
        Neuron(
            each.layer, each.kind, each.part, tuple(0.9 * v for v in each.parameters)
        )
        for each in robot.brain.neurons
    )
    learnt = Brain(neurons, robot.brain.connections[::2])
    clock = replace(
        SETTINGS.simulation, drop_m=SETTINGS.arena.drop_m, window_steps=1400
    )
    off_line = EvaluationSettings(SETTINGS.space, clock, SETTINGS.fitness)
    plain = simulate(robot, off_line).core_position

    def solo(controls: Controls, brain: Brain, ticks: int) -> Switching:
        both = (solo_brain(controls, each, ticks) for each in (brain, learnt))
        return Switching(*both)

    monkeypatch.setattr("worker.robot.control_loop.solo_brain", solo)
    by_hand = simulate(robot, off_line).core_position
    assert not np.array_equal(by_hand, plain)

    world = populated(SETTINGS, [Insertion(A, robot, (0.0, 0.0))])
    world.advance(EXCHANGE)
    first = list(world.population.find(A).window.positions)
    assert np.array_equal(first, by_hand[: len(first)])
    world.apply(Changes(brains=(BrainChange(A, learnt, restarts_window=True),)))
    advance = seconds(world, 6.0)
    second = world.population.find(A).window.positions
    assert np.array_equal(second, by_hand[len(first) - 1 :])
    assert [one.age_s for one in advance.judgements] == [10.0]


@pytest.mark.parametrize("function", ["locomotion", "balance"])
def test_restarted_window_begins_with_the_present_sample(
    turtle: Robot, function: str
) -> None:
    """A window of 12 s is whole 12 s after the restart, not before.

    Balance needs recorded channels.
    """
    settings = replace(SETTINGS, fitness=Fitness(function=function))
    world = populated(settings, [Insertion(A, turtle, (0.0, 0.0))])
    change = BrainChange(A, turtle.brain, restarts_window=True)
    seconds(world, 14.125)
    with pytest.raises(UnexpectedEvent, match="pose_steps = 40, got step 2825"):
        world.apply(Changes(brains=(change,)))
    assert seconds(world, 0.875).judgements[0].is_mature
    world.apply(Changes(brains=(change,)))
    place = world.population.find(A).place
    window = world.population.find(A).window
    assert list(window.positions) == [place]
    assert len(window.rows) == (function == "balance")
    copy = World.restore(settings, world.snapshot())
    (before,) = seconds(world, 11.8).judgements
    (after,) = seconds(world, 0.2).judgements
    assert (before.is_mature, after.is_mature) == (False, True)
    assert window.positions[0] == place
    seconds(copy, 12.0)
    assert copy.digest() == world.digest()


def test_ring_wall_confines_robots(turtle: Robot) -> None:
    """A robot at 1 m/s stays inside; without the wall it slides out."""
    for diameter, is_in in ((1.0, True), (0.0, False)):
        settings = settings_of(wall_diameter_m=diameter, drop_m=0.0)
        world = populated(settings, placed(turtle, (0.0, 0.0)))
        seconds(world, 0.5)
        for _ in range(40):
            world.population.find(A).view.qvel[0] = 1.0
            seconds(world, 0.1)
        assert (world.population.find(A).place[0] < 0.5) is is_in


def test_contacts_of_two_robots_are_recorded(turtle: Robot) -> None:
    """One robot is dropped onto another."""
    settings = settings_of(record_touches=True, drop_m=0.3)
    world = populated(settings, [Insertion(A, turtle, (0.0, 0.0))])
    alone = seconds(world, 1.0)
    world.apply(Changes(insertions=(Insertion(B, turtle, (0.02, 0.01)),)))
    together = seconds(world, 2.0)
    assert alone.touches == ()
    [touch] = together.touches
    assert (touch.first, touch.second) == (A, B)
    assert 0.5 < touch.duration_s < 2.0
    assert world.population.cluster_of[A] is world.population.cluster_of[B]


def light_robot() -> Robot:
    """Return a core with a light sensor that faces world +x, and a hinge."""
    lamp = Part("LightSensor", 0, 2, 0, 0, robots.GREY)
    return robots.robot_of(lamp, Part("ActiveHinge", 0, 3, 0, 0, robots.GREY))


@pytest.mark.parametrize(
    ("light", "is_hidden", "expected"),
    [
        ((0.5, 0.0, 0.0225), False, 1.0),
        ((2.0, 0.0, 0.0225), False, (1.0 / 1.9525) ** 2),
        ((0.5, 0.0, 0.0225), True, 0.0),
        ((-0.5, 0.0, 0.0225), False, 0.0),
    ],
)
def test_light_decreases_with_distance_and_can_be_hidden(
    turtle: Robot,
    light: tuple[float, float, float],
    is_hidden: bool,  # noqa: FBT001 - a case
    expected: float,
) -> None:
    space = Space(
        part_types=(*EXPERIMENT.space.part_types, "schema.parts:LIGHT_SENSOR")
    )
    settings = replace(settings_of(light=light, drop_m=0.0), space=space)
    newborns = [Insertion(A, light_robot(), (0.0, 0.0))]
    if is_hidden:
        newborns.append(Insertion(B, turtle, (0.25, 0.0), 0.5 * math.pi))
    world = populated(settings, newborns)
    reading = world.population.find(A).view.sensors.readings[0, 6]
    assert reading == pytest.approx(expected, abs=0.02)
    world.advance(SECOND)
    reading = world.population.find(A).view.sensors.readings[0, 6]
    assert reading == pytest.approx(expected, abs=0.1)
    assert World.restore(settings, world.snapshot()).digest() == world.digest()


def test_patches_shine_until_the_next_changes() -> None:
    space = Space(
        part_types=(*EXPERIMENT.space.part_types, "schema.parts:LIGHT_SENSOR")
    )
    settings = replace(settings_of(patch_light_m=0.0225, drop_m=0.0), space=space)
    lights = ((2.0, 0.0, 0.0225), (2.0, 0.0, 0.0225), (-0.5, 0.0, 0.0225))
    world = World(settings)
    newborn = Insertion(A, light_robot(), (0.0, 0.0))
    world.apply(Changes(insertions=(newborn,), lights=lights))
    reading = world.population.find(A).view.sensors.readings[0, 6]
    assert reading == pytest.approx(2 * (1.0 / 1.9525) ** 2, abs=0.02)
    world.advance(SECOND)
    again = World.restore(settings, world.snapshot())
    for later in (world, again):
        later.apply(Changes(lights=lights[:1]))
        later.advance(2 * SECOND)
    assert again.digest() == world.digest()
    dark = World.restore(settings, world.snapshot())
    dark.advance(3 * SECOND)
    assert dark.population.find(A).view.sensors.readings[0, 6] == 0.0
    world.apply(Changes(lights=lights[:1]))
    world.advance(3 * SECOND)
    assert dark.digest() != world.digest()
