"""Arenas whose settings change: the physics of it, and equality however it is cut."""

import math
from collections.abc import Callable
from typing import Any

import pytest
from msgspec.structs import replace

from schema.experiment.changes import SettingChange, Values, settings_at
from schema.experiment.document import Fitness
from schema.experiment.environment import Environment
from schema.experiment.settings import ArenaSettings
from schema.limits import ADVANCE_BYTES
from schema.robot.ids import BirthId
from schema.robot.robot import Robot
from schema.wire.arena import Changes
from schema.wire.arena_state import ArenaState
from schema.wire.codec import decode, encode
from tests.schema import robots
from tests.worker.arena.test_environment import WILD, scene
from tests.worker.arena_cases import (
    SECOND,
    Regroupings,
    crowd,
    placed,
    populated,
    seconds,
    settings_of,
    state_of,
)
from worker.arena.world import World

Robots = Callable[[int], Robot]
A = BirthId(0, 0)
BOX = robots.robot_of()
G = 9.81


def changing(*changes: SettingChange, **sections: Any) -> ArenaSettings:  # noqa: ANN401
    """Return settings of an arena in which robots start on the ground."""
    return replace(settings_of(drop_m=0.0), changes=changes, **sections)


def change(setting: str, *values: Values, **keys: Any) -> SettingChange:  # noqa: ANN401
    """Return values that change every second."""
    at = tuple(float(number) for number in range(len(values)))
    return SettingChange(setting=setting, at=at, values=values, **keys)


def test_box_slides_exactly_while_friction_is_below_the_slope() -> None:
    """At 20 degrees, tan a = 0.364: it rests at 0.5 and slides at 0.2.

    It slides for a second by g (sin a - 0.2 cos a) / 2 = 0.756 m.
    """
    slope, friction = (
        Environment(slope_deg=20.0),
        change("simulation.friction", 0.5, 0.2),
    )
    world = populated(changing(friction, environment=slope), placed(BOX, (0.0, 0.0)))
    place = world.population.find(A).view.qpos
    seconds(world, 1.0)
    before = float(place[0])
    seconds(world, 1.0)
    angle = math.radians(20.0)
    expected = -0.5 * G * (math.sin(angle) - 0.2 * math.cos(angle))
    assert abs(before) < 0.01
    assert place[0] - before == pytest.approx(expected, rel=0.03)


def test_box_without_friction_falls_in_the_direction_of_the_slope() -> None:
    """Level for a second, then down along y, the opposite of 90 degrees."""
    settings = changing(
        change("environment.slope_deg", 0.0, 10.0),
        change("simulation.friction", 0.0),
        environment=Environment(slope_direction_deg=90.0),
    )
    world = populated(settings, placed(BOX, (0.0, 0.0)))
    seconds(world, 2.0)
    x, y = world.population.find(A).view.qpos[:2].tolist()
    assert x == pytest.approx(0.0, abs=1e-3)
    assert y == pytest.approx(-0.5 * G * math.sin(math.radians(10.0)), rel=0.02)
    readings = world.population.find(A).view.sensors.readings[0, :3]
    # Without friction it falls freely along the slope.
    assert readings == pytest.approx([0, 0, G * math.cos(math.radians(10))], abs=0.05)


SEASONS = (
    change("simulation.friction", 1.0, 0.2, 0.6, period=3.0),
    change("environment.slope_deg", 0.0, 6.0, between="linear", period=2.0),
    change("environment.slope_direction_deg", 0.0, 90.0, 200.0),
    change("simulation.torque_factor", 1.0, 0.5),
    change("simulation.sensor_noise", 0.0, 0.1),
    change("environment.light", (1.0, 0.0, 0.3), (0.0, 1.0, 0.3)),
    change("fitness.parameters.full_within_m", 1.0, 0.2),
)
WITH_LIGHT = replace(
    WILD,
    light=(5.0, 5.0, 1.0),
    scenery=scene(
        '<geom type="box" size="0.1 0.1 0.1" pos="0.3 0 0.1" friction="0.9 0 0"/>',
        '<geom type="sphere" size="0.15" pos="-0.2 0.3 0"/>',
    ),
)


@pytest.mark.slow
def test_world_is_equal_however_it_is_advanced_and_restored(robot_of: Robots) -> None:
    """Also with robots that meet, part and are born in the middle of a season."""
    settings = changing(
        *SEASONS, environment=WITH_LIGHT, fitness=Fitness(function="light")
    )
    later = crowd(robot_of, 3, 0.5, seed=2, first=30)

    def whole() -> World:
        return populated(settings, crowd(robot_of, 9, 0.4))

    world = whole()
    regrouped = Regroupings(world.population)
    world.advance(2 * SECOND + 50)
    born = world.snapshot()
    world.apply(Changes(insertions=later))
    end = world.advance(5 * SECOND)
    assert regrouped.merges
    assert regrouped.splits

    parts = whole()
    for until in (7, 25, 199, 200, 203, 444, 450):
        parts.advance(until)
    parts.apply(Changes(insertions=later))
    for until in range(451, 5 * SECOND, 61):
        parts.advance(until)
    again = World.restore(settings, born, threads=2)
    again.apply(Changes(insertions=later))
    again.advance(2 * SECOND + 117)
    again = World.restore(settings, again.snapshot())
    assert parts.advance(5 * SECOND).digest == end.digest
    last = again.advance(5 * SECOND)
    assert (last.digest, last.judgements) == (end.digest, end.judgements)


def test_changed_models_equal_those_that_are_built_with_the_values(
    robot_of: Robots,
) -> None:
    """A world in season equals one whose settings are those values from the start.

    So do noise, light and scenery with a friction of its own.
    """
    settings = changing(
        *SEASONS, environment=WITH_LIGHT, fitness=Fitness(function="light")
    )
    world = populated(settings, crowd(robot_of, 6, 0.3))
    seconds(world, 1.0)
    constant = settings_at(settings, 1.0)
    state = decode(ArenaState, world.snapshot(), ADVANCE_BYTES)
    empty = decode(ArenaState, World(constant).snapshot(), ADVANCE_BYTES)
    built = World.restore(constant, encode(replace(state, settings=empty.settings)))
    world.apply(Changes(insertions=crowd(robot_of, 2, 0.3, seed=2, first=20)))
    built.apply(Changes(insertions=crowd(robot_of, 2, 0.3, seed=2, first=20)))
    one, other = seconds(world, 0.95), seconds(built, 0.95)
    assert one.judgements == other.judgements
    for birth in world.births:
        assert state_of(world, birth) == state_of(built, birth)
    seconds(world, 0.25)
    seconds(built, 0.25)
    assert state_of(world, A) != state_of(built, A)
