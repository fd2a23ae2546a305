"""Forward kinematics of a body: frames of its parts, joints at zero.

Rule: the slot points of child and parent coincide, their normals are opposite, and
the child's tangent, rotated by the orientation about the child's normal, equals the
parent's tangent. Source: the code of the original.
"""

import math
from collections.abc import Sequence
from functools import lru_cache

import numpy as np

from schema.parts import BodySpace, Shape, Slot, Vector
from schema.robot.results import Floats
from schema.robot.robot import Robot

_UPRIGHT = np.eye(3)


def shapes_of(robot: Robot, space: BodySpace) -> list[Shape]:
    """Return the shape of each part of a checked robot."""
    return [space[part.kind].shape(part.parameters) for part in robot.parts]


def round_reach(along: Sequence[float], half: Sequence[float]) -> float:
    """Return how far a cylinder reaches from its centre along a direction [m].

    Args:
        along: unit vector in the cylinder's frame, whose z is the axis.
        half: radius, radius, half of the length [m].
    """
    return math.hypot(along[0], along[1]) * half[0] + abs(along[2]) * half[2]


def place_parts(robot: Robot, shapes: Sequence[Shape]) -> tuple[Floats, Floats]:
    """Return each part's frame in the core's frame, joints at zero.

    Args:
        robot: a checked robot.
        shapes: of its parts.

    Returns:
        Rotations (P, 3, 3) part frame to core frame, and positions (P, 3) of the
        part origins [m].
    """
    rotations = np.empty((len(shapes), 3, 3))
    positions = np.zeros((len(shapes), 3))
    rotations[0] = _UPRIGHT
    # Methods and rows taken once are twice as fast for such small arrays.
    turns, places = list(rotations), list(positions)
    for index, part in enumerate(robot.parts[1:], start=1):
        rotation, offset = attach(
            shapes[part.parent].slots[part.parent_slot],
            shapes[index].slots[part.slot],
            part.orientation,
        )
        parent = turns[part.parent]
        parent.dot(rotation, out=turns[index])
        np.add(places[part.parent], parent.dot(offset), out=places[index])
    return rotations, positions


@lru_cache(maxsize=4096)
def attach(parent: Slot, child: Slot, orientation: int) -> tuple[Floats, Floats]:
    """Return a child's frame in its parent's frame.

    Args:
        parent: slot of the parent, in the parent's frame.
        child: slot of the child, in the child's frame.
        orientation: rotation of the child about its own slot normal [degrees].

    Returns:
        Rotation (3, 3) child frame to parent frame; position (3,) of the child's
        origin [m]. Both arrays are shared and read-only.
    """
    nx, ny, nz = parent.normal
    against = (-nx, -ny, -nz)
    parent_rows = (against, parent.tangent, _cross(against, parent.tangent))
    rows, origin = _turned(child, orientation)
    rotation = np.array(parent_rows).T.dot(rows)
    position = parent.position - rotation.dot(origin)
    rotation.flags.writeable = False
    position.flags.writeable = False
    return rotation, position


@lru_cache(maxsize=1024)
def _turned(child: Slot, orientation: int) -> tuple[Floats, Floats]:
    """Return normal, rotated tangent and cross product as rows; and the position."""
    angle = math.radians(orientation)
    cosine, sine = _exact(math.cos(angle)), _exact(math.sin(angle))
    across = _cross(child.normal, child.tangent)
    turned = [t * cosine + a * sine for t, a in zip(child.tangent, across, strict=True)]
    rows = (child.normal, turned, _cross(child.normal, turned))
    return np.array(rows), np.array(child.position)


def _cross(first: Sequence[float], second: Sequence[float]) -> Vector:
    """Return the cross product of two vectors."""
    (ax, ay, az), (bx, by, bz) = first, second
    return (ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx)


def _exact(value: float) -> float:
    """Return the sine or cosine of a quarter turn without rounding error."""
    return float(round(value))
