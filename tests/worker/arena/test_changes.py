"""Diverged robots are removed with a reason, without effect on others."""

from collections.abc import Callable
from dataclasses import replace as changed

import pytest
from msgspec.structs import replace

from schema import parts
from schema.parts import Box, Shape
from schema.plugins.permission import allow
from schema.robot.ids import BirthId
from schema.robot.robot import Robot
from schema.wire.arena import Casualty, Changes, Insertion
from tests.worker.arena_cases import (
    SETTINGS,
    crowd,
    populated,
    seconds,
    settings_of,
    state_of,
)
from worker.arena.world import World

Robots = Callable[[int], Robot]
BAD = BirthId(0, 99)


def _brick(height: float, mass: float) -> Callable[[tuple[float, ...]], Shape]:
    box = Box("body", (0.041, 0.041, height), (0.0, 0.0, 0.0), mass)
    slots = parts.FIXED_BRICK.shape((0.5,) * 3).slots
    return lambda _values: Shape((box,), slots)


HEAVY = changed(parts.FIXED_BRICK, name="Heavy", shape=_brick(0.0355, 1e40))
NOTHING = changed(parts.FIXED_BRICK, name="Nothing", shape=_brick(5e-324, 0.01))
"""Half of its height is rounded to 0, which MuJoCo refuses."""
SPACE = replace(
    SETTINGS.space,
    part_types=(
        *SETTINGS.space.part_types,
        "tests.worker.arena.test_changes:HEAVY",
        "tests.worker.arena.test_changes:NOTHING",
    ),
)
ABSURD = replace(SETTINGS, space=SPACE)


@pytest.fixture(autouse=True)
def _plugins() -> None:
    allow(["tests.worker.arena.test_changes"])


def with_brick(turtle: Robot, kind: str) -> Robot:
    """Return the turtle with one brick of another type."""
    made = [
        replace(part, kind=kind) if index == 2 else part
        for index, part in enumerate(turtle.parts)
    ]
    return Robot(tuple(made), turtle.brain)


@pytest.mark.parametrize("kind", ["Heavy", "Nothing"])
def test_extreme_masses_remove_only_their_robot(
    turtle: Robot, robot_of: Robots, kind: str
) -> None:
    others = crowd(robot_of, 4, 0.5)
    calm, struck = populated(ABSURD, others), populated(ABSURD, others)
    guest = Insertion(BAD, with_brick(turtle, kind), (1.5, 0.0))
    struck.apply(Changes(insertions=(guest,)))
    seconds(calm, 3.0)
    [casualty] = seconds(struck, 3.0).casualties
    assert casualty.birth == BAD
    assert "diverged" in casualty.reason or "cannot be built" in casualty.reason
    assert casualty.place[:2] == pytest.approx((1.5, 0.0), abs=0.5)
    assert struck.births == calm.births
    for birth in calm.births:
        assert state_of(struck, birth) == state_of(calm, birth)


def test_only_the_diverged_member_of_a_cluster_is_removed(turtle: Robot) -> None:
    near = [Insertion(BirthId(0, n), turtle, (0.262 * n, 0.0)) for n in range(3)]
    world = populated(SETTINGS, near)
    seconds(world, 1.0)
    middle = world.population.find(BirthId(0, 1))
    assert len(world.population.clusters) == 1
    middle.view.qvel[0] = float("nan")
    casualties = seconds(world, 1.0).casualties
    assert [casualty.birth for casualty in casualties] == [middle.birth]
    assert casualties[0].reason == "physics diverged: state not finite"
    assert 200 < casualties[0].step <= 208
    assert world.births == (BirthId(0, 0), BirthId(0, 2))
    assert seconds(world, 1.0).casualties == ()


def test_core_above_the_greatest_speed_is_removed(turtle: Robot) -> None:
    world = populated(SETTINGS, [Insertion(BAD, turtle, (0.0, 0.0))])
    seconds(world, 1.0)
    world.population.find(BAD).view.qvel[:3] = (30.0, 0.0, 30.0)
    [casualty] = seconds(world, 1.0).casualties
    assert "m/s, more than 20 m/s" in casualty.reason
    assert world.births == ()


def test_unbuildable_robot_is_reported_after_a_restore(turtle: Robot) -> None:
    world = World(ABSURD)
    guest = Insertion(BAD, with_brick(turtle, "Nothing"), (1.0, 0.0))
    world.apply(Changes(insertions=(guest,)))
    restored = World.restore(ABSURD, world.snapshot())
    [casualty] = seconds(restored, 1.0).casualties
    assert isinstance(casualty, Casualty)
    assert casualty.birth == BAD
    assert seconds(restored, 1.0).casualties == ()


@pytest.mark.parametrize(
    ("memory", "drop_m", "message"),
    [
        (1 << 9, 0.25, "cannot be built: "),
        (1 << 12, 0.25, "physics diverged: "),
        (1 << 11, 0.0, "physics diverged: "),
    ],
)
def test_engine_failure_removes_only_its_robot(
    turtle: Robot,
    monkeypatch: pytest.MonkeyPatch,
    memory: int,
    drop_m: float,
    message: str,
) -> None:
    """During compilation, in the air, or at birth."""
    world = populated(
        settings_of(drop_m=drop_m), [Insertion(BirthId(0, 1), turtle, (0.0, 0.0))]
    )
    with monkeypatch.context() as patch:
        patch.setattr("schema.mjcf.model.MEMORY_BYTES", memory)
        world.apply(Changes(insertions=(Insertion(BAD, turtle, (1.5, 0.0)),)))
    [casualty] = seconds(world, 1.0).casualties
    assert casualty.birth == BAD
    assert casualty.reason.startswith(message)
    assert "out of memory" in casualty.reason
    assert "\n" not in casualty.reason
    assert world.births == (BirthId(0, 1),)
    assert seconds(world, 1.0).casualties == ()


def raises(_track: object, _fitness: object) -> float:
    """Raise for every track."""
    raise ZeroDivisionError


def test_undefined_fitness_removes_the_robot_with_the_reason(turtle: Robot) -> None:
    fitness = replace(
        SETTINGS.fitness, function="tests.worker.arena.test_changes:raises"
    )
    settings = replace(SETTINGS, fitness=fitness)
    world = populated(settings, [Insertion(BAD, turtle, (0.0, 0.0))])
    assert seconds(world, 5.0).casualties == ()
    [casualty] = seconds(world, 2.0).casualties
    assert "ZeroDivisionError" in casualty.reason
    assert world.births == ()
