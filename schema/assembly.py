"""Where each part of a body sits, joints at zero.

Rule: a child's slot normal points against its parent's, the slot points meet, and
the child's tangent, first turned by the orientation about the child's own normal,
falls on the parent's. Source: facts of the original, section 2.
"""

import math
from collections.abc import Sequence
from functools import lru_cache

import numpy as np

from schema.evaluation import Floats
from schema.parts import BodySpace, Slot, Vector
from schema.robot import Robot


def place_parts(robot: Robot, space: BodySpace) -> tuple[Floats, Floats]:
    """Return each part's frame in the core's frame, joints at zero.

    Args:
        robot: a checked robot.
        space: its part types.

    Returns:
        Rotations (P, 3, 3) part frame to core frame, and positions (P, 3) of the
        part origins [m].
    """
    count = len(robot.parts)
    rotations = np.empty((count, 3, 3))
    positions = np.empty((count, 3))
    rotations[0], positions[0] = np.eye(3), 0.0
    slots = [space[part.kind].shape(part.parameters).slots for part in robot.parts]
    for index, part in enumerate(robot.parts[1:], start=1):
        rotation, offset = attach(
            slots[part.parent][part.parent_slot],
            slots[index][part.slot],
            part.orientation,
        )
        parent = rotations[part.parent]
        rotations[index] = parent @ rotation
        positions[index] = positions[part.parent] + parent @ offset
    return rotations, positions


@lru_cache(maxsize=4096)
def attach(parent: Slot, child: Slot, orientation: int) -> tuple[Floats, Floats]:
    """Return a child's frame in its parent's frame.

    Args:
        parent: slot of the parent, in the parent's frame.
        child: slot of the child, in the child's frame.
        orientation: turn of the child about its own slot normal [degrees].

    Returns:
        Rotation (3, 3) child frame to parent frame; position (3,) of the child's
        origin [m]. Both are shared: do not write to them.
    """
    # The parent's tangent and normal seen by the child, then their frames' quotient.
    angle = math.radians(orientation)
    cosine, sine = _exact(math.cos(angle)), _exact(math.sin(angle))
    across = _cross(child.normal, child.tangent)
    turned = [t * cosine + a * sine for t, a in zip(child.tangent, across, strict=True)]
    rows = np.array((child.normal, turned, _cross(child.normal, turned)))
    nx, ny, nz = parent.normal
    against = (-nx, -ny, -nz)
    parent_rows = (against, parent.tangent, _cross(against, parent.tangent))
    rotation = np.array(parent_rows).T @ rows
    position = np.array(parent.position) - rotation @ np.array(child.position)
    rotation.flags.writeable = False
    position.flags.writeable = False
    return rotation, position


def _cross(first: Sequence[float], second: Sequence[float]) -> Vector:
    """Return the cross product of two vectors."""
    (ax, ay, az), (bx, by, bz) = first, second
    return (ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx)


def _exact(value: float) -> float:
    """Return sine or cosine of a quarter turn without its rounding error."""
    return float(round(value))
