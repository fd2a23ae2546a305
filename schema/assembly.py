"""Where each part of a body sits, joints at zero.

Rule: a child's slot normal points against its parent's, the slot points meet, and
the child's tangent, first turned by the orientation about the child's own normal,
falls on the parent's. Source: facts of the original, section 2.
"""

import math
from functools import lru_cache

import numpy as np

from schema.evaluation import Floats
from schema.parts import BodySpace, Slot
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
    normal = np.asarray(child.normal)
    tangent = np.asarray(child.tangent)
    angle = math.radians(orientation)
    turned = tangent * _exact(math.cos(angle)) + np.cross(normal, tangent) * _exact(
        math.sin(angle)
    )
    child_frame = np.column_stack((normal, turned, np.cross(normal, turned)))
    against = -np.asarray(parent.normal)
    along = np.asarray(parent.tangent)
    parent_frame = np.column_stack((against, along, np.cross(against, along)))
    rotation = parent_frame @ child_frame.T
    position = np.asarray(parent.position) - rotation @ np.asarray(child.position)
    rotation.flags.writeable = False
    position.flags.writeable = False
    return rotation, position


def _exact(value: float) -> float:
    """Return sine or cosine of a quarter turn without its rounding error."""
    return float(round(value))
