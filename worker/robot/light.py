"""Light sensors in a world that has a light.

The light is a point. A sensor faces along its part's x axis from the face of its
box and reads cos(theta) min(1, (1 m / d)^2): theta is the angle between its axis
and the direction of the light, d the distance of the light. It reads 0 if the light
is behind it or hidden by a robot, a wall or scenery. Source: own; the fall with
distance is that of the original's PointIntensity sensor. No camera is used, so
births and deaths do not disturb the readings.
"""

from collections.abc import Sequence

import mujoco
import numpy as np

from schema.parts import Vector
from schema.robot.results import Floats
from worker.robot.devices import Sensors

World = tuple[mujoco.MjModel, mujoco.MjData]
"""Model and state of some robots; the kinematics are those of the present pose."""
FULL_WITHIN_M = 1.0
"""Distance within which the light has full brightness."""
_OUTSIDE_M = 1e-6
"""Distance from a sensor's face at which its ray starts."""


def read_light(
    light: Vector, sensors: Sensors, own: World, worlds: Sequence[World]
) -> None:
    """Write the readings of one robot's light sensors.

    Args:
        light: position of the light, world frame [m].
        sensors: of the robot.
        own: world that holds the robot.
        worlds: whose geoms may hide the light, ``own`` included.
    """
    for geom, place in sensors.lights:
        sensors.readings[0, place] = _brightness(light, own, geom, worlds)


def _brightness(light: Vector, own: World, geom: int, worlds: Sequence[World]) -> float:
    model, data = own
    outward = data.geom_xmat[geom].reshape(3, 3)[:, 0]
    face = float(model.geom_size[geom][0]) + _OUTSIDE_M
    start = data.geom_xpos[geom] + face * outward
    ray = np.array(light) - start
    distance = float(np.sqrt(ray @ ray))
    if distance == 0.0:
        return 1.0
    slope = float(ray @ outward) / distance
    if slope <= 0.0 or _is_hidden(worlds, start, ray):
        return 0.0
    return slope * min(1.0, (FULL_WITHIN_M / distance) ** 2)


def _is_hidden(worlds: Sequence[World], start: Floats, ray: Floats) -> bool:
    """Return whether a geom lies between a sensor's face and the end of its ray."""
    hit = np.zeros(1, dtype=np.int32)
    for model, data in worlds:
        share = mujoco.mj_ray(model, data, start, ray, None, 1, -1, hit)
        if 0.0 <= share < 1.0:
            return True
    return False
