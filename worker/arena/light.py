"""Light sensors of an arena; ``worker.robot.light`` has the formula."""

from collections.abc import Sequence

from schema.parts import Vector
from worker.clusters.population import ArenaPopulation
from worker.clusters.robot import ArenaRobot
from worker.robot.light import read_light


def read_lights(
    light: Vector, population: ArenaPopulation, robots: Sequence[ArenaRobot]
) -> None:
    """Write the readings of some robots' light sensors.

    Args:
        light: position of the light, world frame [m].
        population: all robots of the arena; any of them may hide the light.
        robots: whose sensors to read.
    """
    views = [robot.view for robot in robots if robot.view.sensors.lights]
    if not views:
        return
    population.kinematics()
    worlds = [(cluster.model, cluster.data) for cluster in population.clusters]
    for view in views:
        read_light(light, view.sensors, (view.model, view.data), worlds)
