"""Boxes and hulls spare the measuring of pairs; they never decide who meets."""

from collections.abc import Callable

import numpy as np
import pytest

from schema.robot.robot import Robot
from tests.worker.arena_cases import crowd, populated, seconds, settings_of
from worker.arena.world import World
from worker.clusters.proximity import FASTEST, Pairs, Proximity, Scene

Robots = Callable[[int], Robot]


def measured(world: World, scene: Scene, gap_m: float) -> Pairs:
    """Return who is to meet below a gap, every pair that lives apart measured."""
    population, settings = world.population, world.population.model_cache.settings
    steps = settings.arena.proximity_steps + 1
    moves = np.minimum(scene.speeds[0], FASTEST) * steps * 0.005
    births = [one.birth for one in population.robots]
    return [
        (first, second)
        for first, here in enumerate(births)
        for second, there in enumerate(births)
        if first < second
        and population.cluster_of(here) is not population.cluster_of(there)
        and scene.distances([(first, second)])[0, 0]
        < moves[first] + moves[second] + gap_m
    ]


@pytest.mark.parametrize("gap_m", [0.02, 0.1, 0.5])
def test_nobody_is_spared_who_is_to_meet(robot_of: Robots, gap_m: float) -> None:
    """In a falling crowd, by merge distances beyond those that it lives by."""
    world = populated(settings_of(drop_m=0.5), crowd(robot_of, 20, 1.2))
    proximity = Proximity(settings_of(merge_distance_m=gap_m))
    pairs = 0
    for _ in range(12):
        seconds(world, 0.125)
        layout = world.population.layout
        scene = Scene(layout, layout.read()[np.newaxis])
        found = proximity.pairs_to_merge(scene)[0]
        assert found == measured(world, scene, gap_m)
        pairs += len(found)
    assert pairs > 0 or gap_m < 0.1
