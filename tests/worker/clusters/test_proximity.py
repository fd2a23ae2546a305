"""Boxes and hulls save distance measurements and do not change the pairs."""

from collections.abc import Callable

import numpy as np
import pytest

from schema.robot.robot import Robot
from tests.worker.arena_cases import crowd, populated, seconds, settings_of
from worker.arena.world import World
from worker.clusters.proximity import FASTEST, Pairs, Proximity, Scene

Robots = Callable[[int], Robot]


def measured(world: World, scene: Scene, gap_m: float) -> Pairs:
    """Return the pairs to merge, from the distances of all pairs of clusters."""
    population, settings = world.population, world.population.model_cache.settings
    steps = settings.arena.proximity_steps + 1
    moves = np.minimum(scene.speeds[0], FASTEST) * steps * 0.005
    births = [one.birth for one in population.robots]
    return [
        (first, second)
        for first, here in enumerate(births)
        for second, there in enumerate(births)
        if first < second
        and population.cluster_of[here] is not population.cluster_of[there]
        and scene.distances([(first, second)])[0, 0]
        < moves[first] + moves[second] + gap_m
    ]


@pytest.mark.parametrize("gap_m", [0.02, 0.1, 0.5])
def test_pairs_to_merge_equal_those_of_all_measurements(
    robot_of: Robots, gap_m: float
) -> None:
    """For falling robots, with distances greater than the arena's as well."""
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
