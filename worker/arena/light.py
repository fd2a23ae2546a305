"""What light sensors read in an arena that has a light.

The light is a point. A sensor looks along its part's x axis from the face of its
box and reads cos(theta) min(1, (1 m / d)^2): theta is the angle between where it
looks and where the light is, d how far away that is. It reads 0 with the light
behind it or with a robot or a wall in between. Source: own; the fall with distance
is that of the original's PointIntensity sensor (facts, section 1.2), and no camera
takes part, so that births and deaths disturb nothing.
"""

from collections.abc import Sequence

import mujoco
import numpy as np

from schema.parts import Vector
from worker.clusters.cluster import Cluster
from worker.clusters.engine_view import EngineView
from worker.clusters.population import ArenaPopulation
from worker.clusters.robot import ArenaRobot

FULL_WITHIN_M = 1.0
"""Within this distance the light is as bright as it gets."""
_OUTSIDE_M = 1e-6
"""So far before its face a sensor's ray starts."""


def shine(population: ArenaPopulation, people: Sequence[ArenaRobot]) -> None:
    """Fill in what the light sensors of some robots read, if there is a light.

    Args:
        population: all of the arena, any of whom may stand in the way.
        people: whose sensors.
    """
    source = population.model_cache.settings.arena.light
    views = [one.view for one in people if one.view.senses.lights]
    if source is None or not views:
        return
    population.kinematics()
    for view in views:
        for geom, place in view.senses.lights:
            view.senses.readings[0, place] = _brightness(
                source, population.clusters, view, geom
            )


def _brightness(
    light: Vector, clusters: Sequence[Cluster], view: EngineView, geom: int
) -> float:
    model, data = view.model, view.data
    outward = data.geom_xmat[geom].reshape(3, 3)[:, 0]
    face = float(model.geom_size[geom][0]) + _OUTSIDE_M
    eye = data.geom_xpos[geom] + face * outward
    ray = np.array(light) - eye
    distance = float(np.sqrt(ray @ ray))
    if distance == 0.0:
        return 1.0
    slope = float(ray @ outward) / distance
    if slope <= 0.0 or _is_hidden(clusters, eye, ray):
        return 0.0
    return slope * min(1.0, (FULL_WITHIN_M / distance) ** 2)


def _is_hidden(clusters: Sequence[Cluster], eye: np.ndarray, ray: np.ndarray) -> bool:
    """Return whether anything opaque stands between an eye and the ray's end."""
    hit = np.zeros(1, dtype=np.int32)
    for cluster in clusters:
        share = mujoco.mj_ray(cluster.model, cluster.data, eye, ray, None, 1, -1, hit)
        if 0.0 <= share < 1.0:
            return True
    return False
