"""Forward kinematics of a body: frames of its parts, joints at zero.

Rule: the slot points of child and parent coincide, their normals are opposite, and
the child's tangent, rotated by the orientation about the child's normal, equals the
parent's tangent. Source: the code of the original.
"""

import math
from collections.abc import Sequence
from functools import lru_cache
from itertools import chain

import numpy as np

from schema.parts import BodySpace, Shape, Slot
from schema.robot.robot import Robot
from schema.robot.trace import Floats

_UPRIGHT = np.eye(3)
_TURNS = {0: (1.0, 0.0), 90: (0.0, 1.0), 180: (-1.0, 0.0), 270: (0.0, -1.0)}
"""Cosine and sine of each orientation, without rounding errors."""
_NEXT, _AFTER = np.array([1, 2, 0]), np.array([2, 0, 1])


def shapes_of(robot: Robot, space: BodySpace) -> list[Shape]:
    """Return the shape of each part of a checked robot."""
    return [space[part.kind].shape(part.parameters) for part in robot.parts]


def round_reach(along: Sequence[float], half: Sequence[float]) -> float:
    """Return how far a cylinder reaches from its centre along a unit vector [m].

    The vector is in the cylinder's frame, whose z is the axis; ``half`` has radius,
    radius and half of the length [m].
    """
    return math.hypot(along[0], along[1]) * half[0] + abs(along[2]) * half[2]


def place_parts(robot: Robot, shapes: Sequence[Shape]) -> tuple[Floats, Floats]:
    """Return each part's frame in the core's frame, joints at zero.

    Rotations (P, 3, 3) part frame to core frame, and positions (P, 3) of the origins
    [m].
    """
    turns, offsets = _attached(
        [
            (
                shapes[part.parent].slots[part.parent_slot],
                shape.slots[part.slot],
                part.orientation,
            )
            for part, shape in zip(robot.parts[1:], shapes[1:], strict=True)
        ]
    )
    rotations = np.empty((len(shapes), 3, 3))
    positions = np.zeros((len(shapes), 3))
    rotations[0] = _UPRIGHT
    # Methods and rows taken once are twice as fast for such small arrays.
    frames, places = list(rotations), list(positions)
    for index, (part, turn, offset) in enumerate(
        zip(robot.parts[1:], turns, offsets, strict=True), start=1
    ):
        parent = frames[part.parent]
        parent.dot(turn, out=frames[index])
        np.add(places[part.parent], parent.dot(offset), out=places[index])
    return rotations, positions


@lru_cache(maxsize=4096)
def attach(parent: Slot, child: Slot, orientation: int) -> tuple[Floats, Floats]:
    """Return a child's frame in its parent's, given the slots of both in their frames.

    The orientation is a rotation of the child about its own slot normal [degrees]. The
    rotation (3, 3) is child frame to parent frame, the position (3,) that of the
    child's origin [m]; both are shared and read-only.
    """
    (rotation,), (position,) = _attached([(parent, child, orientation)])
    rotation.flags.writeable = False
    position.flags.writeable = False
    return rotation, position


def _attached(ends: Sequence[tuple[Slot, Slot, int]]) -> tuple[Floats, Floats]:
    """Return rotations (K, 3, 3) and positions (K, 3) as ``attach`` for each pair."""
    rows = [
        (parent.normal + parent.tangent + parent.position)
        + (child.normal + child.tangent + child.position)
        + _TURNS[orientation]
        for parent, child, orientation in ends
    ]
    table = np.fromiter(chain.from_iterable(rows), float).reshape(-1, 20)
    cosine, sine = table[:, 18:19], table[:, 19:]
    # Rows of each slot: normal, tangent, and their cross product in place of position.
    slots = table[:, :18].reshape(-1, 2, 3, 3)
    positions = slots[:, :, 2].copy()
    slots[:, 0, 0] *= -1.0
    normal, tangent = slots[:, 1, 0], slots[:, 1, 1]
    slots[:, 1, 1] = tangent * cosine + _cross(normal, tangent) * sine
    slots[:, :, 2] = _cross(slots[:, :, 0], slots[:, :, 1])
    rotations = slots[:, 0].transpose(0, 2, 1) @ slots[:, 1]
    return rotations, positions[:, 0] - (rotations @ positions[:, 1, :, None])[:, :, 0]


def _cross(first: Floats, second: Floats) -> Floats:
    one, other = first.take(_NEXT, -1), first.take(_AFTER, -1)
    product: Floats = one * second.take(_AFTER, -1) - other * second.take(_NEXT, -1)
    return product
