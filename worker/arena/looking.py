"""Light sensors and own sensors in an arena, which see the other robots, too."""

from collections.abc import Sequence

import numpy as np

from schema.errors import SensorFailed
from schema.wire.arena import Casualty
from worker.clusters.population import ArenaPopulation
from worker.clusters.robot import ArenaRobot
from worker.robot.own_sensors import Surroundings


def look(
    population: ArenaPopulation, robots: Sequence[ArenaRobot], step: int
) -> list[Casualty]:
    """Write readings of light sensors and own ones; return robots of failed sensors."""
    looking = [robot for robot in robots if robot.view.sensors.looks]
    if not looking:
        return []
    population.kinematics()
    settings = population.model_cache.settings
    places = np.array([robot.view.qpos[:3] for robot in population.robots])
    rows = population.robot_rows.rows
    failed = []
    for robot in looking:
        sensors = robot.view.sensors
        cluster = population.cluster_of[robot.birth]
        is_newborn = step == robot.window.born
        around = Surroundings(
            (step - robot.window.born) * settings.simulation.timestep_s,
            # Nothing has been stepped since a birth.
            sensors.touching() if is_newborn else cluster.touched,
            [(c.model, c.data) for c in population.clusters if c is not cluster],
            np.delete(places, rows[robot.birth], axis=0),
            settings.light,
        )
        try:
            sensors.look(around)
        except SensorFailed as error:
            x, y, z = robot.view.qpos[:3].tolist()
            failed.append(Casualty(robot.birth, step, str(error), (x, y, z)))
    return failed
