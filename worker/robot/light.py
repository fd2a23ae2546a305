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
from schema.robot.trace import Floats

State = tuple[mujoco.MjModel, mujoco.MjData]
"""Model and data of some robots."""
FULL_WITHIN_M = 1.0
"""Distance within which the light has full brightness."""
_OUTSIDE_M = 1e-6
"""Distance from a sensor's face at which its ray starts."""


def brightness(
    light: Vector, state: State, geom: int, others: Sequence[State]
) -> float:
    """Return the reading of a light sensor.

    Args:
        light: position of the light, world frame [m].
        state: model and data that hold the sensor; frames are those of the state.
        geom: box of the sensor.
        others: other models of the same world, whose geoms may hide the light, too.
    """
    model, data = state
    outward = data.geom_xmat[geom].reshape(3, 3)[:, 0]
    face = float(model.geom_size[geom][0]) + _OUTSIDE_M
    start = data.geom_xpos[geom] + face * outward
    ray = np.array(light) - start
    distance = float(np.sqrt(ray @ ray))
    if distance == 0.0:
        return 1.0
    slope = float(ray @ outward) / distance
    ends = (ray_share(world, start, ray) for world in (state, *others))
    if slope <= 0.0 or any(share < 1.0 for share in ends):
        return 0.0
    return slope * min(1.0, (FULL_WITHIN_M / distance) ** 2)


def ray_share(state: State, start: Floats, ray: Floats, but: int = -1) -> float:
    """Return where a ray meets the first geom, in its lengths; infinite if it does not.

    Args:
        state: model and data; frames are those of the state.
        start: (3,) of the ray, world frame [m].
        ray: (3,) its direction and length.
        but: body whose geoms it passes; -1 is none.
    """
    hit = np.zeros(1, dtype=np.int32)
    share = mujoco.mj_ray(*state, start, ray, None, 1, but, hit)
    return share if hit[0] >= 0 else np.inf
