"""Boxes and hulls save distance measurements and do not change the pairs."""

from collections.abc import Callable
from itertools import combinations

import numpy as np
import pytest

from schema.robot.robot import Robot
from tests.worker.arena_cases import crowd, populated, seconds, settings_of
from worker.arena.world import World
from worker.clusters.proximity import FASTEST, Proximity, RobotBounds
from worker.clusters.states import Pairs

Robots = Callable[[int], Robot]


def pairs_of_clusters(world: World) -> Pairs:
    """Return all pairs of robots in different clusters."""
    clusters = [world.population.cluster_of[birth] for birth in world.births]
    pairs = combinations(range(len(clusters)), 2)
    return [pair for pair in pairs if clusters[pair[0]] is not clusters[pair[1]]]


def measured(world: World, bounds: RobotBounds, pairs: Pairs, gap_m: float) -> Pairs:
    """Return the pairs that are near, from the distances of all of them."""
    steps = world.population.model_cache.settings.arena.proximity_steps + 1
    moves = np.minimum(bounds.speeds[0], FASTEST) * steps * 0.005
    return [
        (first, second)
        for first, second in pairs
        if distance(world, first, second) < moves[first] + moves[second] + gap_m
    ]


def distance(world: World, first: int, second: int) -> float:
    """Return the least distance of a sphere of each of two robots [m]."""
    layout = world.population.layout
    rows = layout.robot_rows
    spheres = np.arange(len(rows.radii))
    (centres,) = layout.spheres(layout.read()[np.newaxis], spheres)
    owners = np.searchsorted(rows.first_bodies, rows.sphere_bodies, side="right") - 1
    here, there = owners == first, owners == second
    gaps = centres[:, here, None] - centres[:, None, there]
    apart = np.sqrt((gaps**2).sum(axis=0)) - rows.radii[here, None] - rows.radii[there]
    return float(apart.min())


@pytest.mark.parametrize("gap_m", [0.02, 0.1, 0.5])
def test_pairs_to_merge_and_to_keep_equal_those_of_all_measurements(
    robot_of: Robots, gap_m: float
) -> None:
    """For falling robots, with distances greater than the arena's as well."""
    world = populated(settings_of(drop_m=0.5), crowd(robot_of, 20, 1.2))
    proximity = Proximity(settings_of(merge_distance_m=gap_m, split_distance_m=gap_m))
    pairs = 0
    for _ in range(12):
        seconds(world, 0.125)
        layout = world.population.layout
        bounds = RobotBounds(layout, layout.read()[np.newaxis])
        found = proximity.pairs_to_merge(bounds)[0]
        pairs_apart = pairs_of_clusters(world)
        assert found == measured(world, bounds, pairs_apart, gap_m)
        assert not pairs_apart or proximity.pairs_to_keep(bounds, pairs_apart) == found
        pairs += len(found)
    assert pairs > 0 or gap_m < 0.1
