"""Merges and splits of clusters; no contact of robots is missed."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from msgspec.structs import replace

from schema.experiment.document import Space
from schema.plugins.permission import allow
from schema.robot.brain import INPUT, Brain, Neuron
from schema.robot.ids import BirthId
from schema.robot.robot import Part, Robot
from schema.robot.trace import Floats
from schema.wire.arena import Casualty, Changes, Insertion, Touch
from tests.schema import robots
from tests.worker.arena_cases import (
    SETTINGS,
    Regroupings,
    counted,
    crowd,
    populated,
    seconds,
    settings_of,
)
from tests.worker.arena_oracle import Oracle
from worker.arena.world import World

Robots = Callable[[int], Robot]


def live(
    robot_of: Robots, *, radius_m: float, drop_m: float, lives: int, seed: int
) -> tuple[World, Oracle, int]:
    """Return an arena after ``lives`` seconds of births and deaths, and its merges.

    Four robots are born per second; the oldest beyond 30 are removed.
    """
    world = World(settings_of(drop_m=drop_m), threads=2)
    regrouped = Regroupings(world.population)
    oracle = Oracle(world)
    rng = np.random.default_rng(seed)
    for second in range(lives):
        newborns = crowd(robot_of, 4, radius_m, seed=seed + second, first=4 * second)
        gone = world.births[: max(0, len(world.births) + 4 - 30)]
        world.apply(Changes(gone, newborns))
        seconds(world, 1.0)
        if rng.random() < 0.2:
            world.apply(Changes(removals=world.births[::5]))
    world.close()
    return world, oracle, regrouped.merges


@pytest.mark.slow
def test_no_contact_is_missed_in_long_runs(robot_of: Robots) -> None:
    """Over 5,000 pair-steps in contact and 100 merges."""
    pair_steps = merges = 0
    for radius_m, drop_m in ((1.4, 0.25), (0.9, 0.25), (0.5, 0.5), (0.35, 1.0)):
        _, oracle, merged = live(
            robot_of, radius_m=radius_m, drop_m=drop_m, lives=8, seed=7
        )
        assert oracle.missed == []
        pair_steps += oracle.pair_steps
        merges += merged
    assert pair_steps >= 5_000
    assert merges >= 100


@pytest.mark.slow
def test_pile_of_thirty_robots_stays_finite(robot_of: Robots) -> None:
    world = World(settings_of(drop_m=0.8), threads=2)
    rng = np.random.default_rng(3)
    casualties: list[Casualty] = []
    for number in range(30):
        place = (float(rng.uniform(-0.05, 0.05)), float(rng.uniform(-0.05, 0.05)))
        newborn = Insertion(BirthId(0, number), robot_of(number), place)
        world.apply(Changes(insertions=(newborn,)))
        casualties += seconds(world, 0.5).casualties
    advance = seconds(world, 2.0)
    assert not casualties
    assert not advance.casualties
    largest = max(len(cluster.members) for cluster in world.population.clusters)
    assert largest == 30
    for judgement in advance.judgements:
        assert np.isfinite(judgement.place).all()
        assert np.hypot(*judgement.place[:2]) < 1.5
        assert -0.01 < judgement.place[2] < 0.6
    world.close()


def test_separated_robots_are_split(turtle: Robot) -> None:
    """Merged below 2 cm, split beyond 6 cm, then each in its own model."""
    near = [
        Insertion(BirthId(0, number), turtle, (0.3 * number, 0.0)) for number in (0, 1)
    ]
    world, regrouped = counted(SETTINGS, near)
    seconds(world, 1.0)
    first, second = (world.population.find(i.birth) for i in near)
    sizes = []
    for gap in (0.3, 0.2, 0.3, 0.6):
        for one, x in ((first, 0.0), (second, gap)):
            one.view.qpos[:2] = (x, 0.0)
        seconds(world, 1.0)
        sizes.append(len(world.population.clusters))
    assert sizes[1] == 1
    assert sizes[-1] == 2
    assert first.view is first.body.solo.views[0]
    assert (regrouped.merges, regrouped.splits) == (1, 1)


@pytest.mark.parametrize(("core", "imu"), [("", 6), ("crawlers:BLIND_CORE", 0)])
def test_touch_sensors_of_survivors_keep_their_contacts(core: str, imu: int) -> None:
    """One of two robots of a cluster dies at a tick, the other lies on its sensor.

    Robots without an imu at their centre are read one by one.
    """
    allow([str(Path(__file__).parents[2] / "plugins" / "crawlers.py")])
    settings, robot = settings_of(drop_m=0.0), on_its_sensor(imu)
    if core:
        space = replace(settings.space, part_types=(core, *Space().part_types[1:]))
        settings = replace(settings, space=space)
    first, second = BirthId(0, 0), BirthId(0, 1)
    found: list[Floats] = []
    for velocity in (None, 1e3):
        world = populated(
            settings,
            [Insertion(first, robot, (0.0, 0.0)), Insertion(second, robot, (0.12, 0))],
        )
        world.advance(1024)
        assert [each.members for each in world.population.clusters] == [(first, second)]
        if velocity is not None:
            world.population.find(second).view.qvel[0] = velocity
        gone = world.advance(1025).casualties
        assert [each.birth for each in gone] == [second] * (velocity is not None)
        readings = world.population.find(first).view.sensors.readings
        found.append(readings[0, imu : imu + 2].copy())
    assert found[0].any()
    assert found[0].tolist() == found[1].tolist()


def test_contacts_of_survivors_are_counted_when_a_cluster_mate_diverges() -> None:
    """Two robots overlap by 0.5 mm; the third diverges at one of five checks."""
    robot = robots.robot_of()
    births = [BirthId(0, number) for number in range(3)]
    places = zip(births, (0.0, 0.0895, 0.19), strict=True)
    newborns = [Insertion(birth, robot, (x, 0.0)) for birth, x in places]
    found: list[tuple[Touch, ...]] = []
    for velocity in (0.0, 60.0):
        world = populated(settings_of(drop_m=0.0, record_touches=True), newborns)
        world.advance(25)
        assert [each.members for each in world.population.clusters] == [(*births,)]
        world.population.find(births[2]).view.qvel[2] = velocity
        advance = world.advance(50)
        assert len(advance.casualties) == (velocity > 0.0)
        found.append(advance.touches)
    assert found[0] == found[1]
    assert [(each.first, each.second) for each in found[0]] == [(births[0], births[1])]


def test_survivor_merges_at_the_check_at_which_its_cluster_mate_diverges() -> None:
    """The cluster that it is alone in at that check is replaced at once."""
    robot = on_its_sensor()
    first, second, third = (BirthId(0, number) for number in range(3))
    places = ((first, 0.0), (second, 0.12), (third, -0.4))
    world = populated(
        settings_of(drop_m=0.0), [Insertion(one, robot, (x, 0.0)) for one, x in places]
    )
    world.advance(25)
    world.population.find(second).view.qvel[2] = 60.0
    world.population.find(third).view.qpos[0] = -0.12
    gone = world.advance(50).casualties
    assert [each.birth for each in gone] == [second]
    members = [each.members for each in world.population.clusters]
    assert members == [(first, third)]


def on_its_sensor(imu: int = 6) -> Robot:
    """Return a core that turns a touch sensor to the ground."""
    hinge = Part("ActiveHinge", 0, 0, 0, 0, robots.GREY)
    parts = (robots.CORE, hinge, Part("TouchSensor", 1, 1, 0, 0, robots.GREY))
    inputs = [Neuron("input", INPUT, part) for part in (0,) * imu + (2,) * 2]
    return Robot(parts, Brain((*inputs, Neuron("output", "Simple", 1, (1.0, 1.0)))))
