"""Boxes and cylinders of a body in the core's frame, joints at zero."""

import math
from dataclasses import dataclass
from functools import lru_cache
from itertools import chain

import numpy as np
import numpy.typing as npt

from schema.parts import IDENTITY, BodySpace, Shape, Vector
from schema.robot.frames import place_parts, round_reach, shapes_of
from schema.robot.results import Floats
from schema.robot.robot import Robot

Indices = npt.NDArray[np.intp]


@dataclass(frozen=True, slots=True)
class Boxes:
    """All boxes of a body, in the core's frame.

    Attributes:
        count: (P,) number of boxes of each part; boxes are ordered by part.
        rotation: (N, 3, 3) box frame to core frame.
        centre: (N, 3) [m].
        half: (N, 3) half of the lengths along the box's own axes [m].
        lower, upper: (N, 3) corners of each box's axis-aligned hull [m].
        mass: total mass [kg].
        round: indices of those that are cylinders, ascending.
    """

    count: Indices
    rotation: Floats
    centre: Floats
    half: Floats
    lower: Floats
    upper: Floats
    mass: float
    round: tuple[int, ...] = ()


def place_boxes(robot: Robot, space: BodySpace) -> Boxes:
    """Return the boxes of a checked robot.

    Args:
        robot: a checked robot.
        space: its part types.

    Returns:
        Its boxes by part, in the order of each part's shape.
    """
    shapes = shapes_of(robot, space)
    rotations, positions = place_parts(robot, shapes)
    tables = [_table(shape) for shape in shapes]
    count = np.array([len(table.masses) for table in tables])
    lengths = np.concatenate([table.lengths for table in tables])
    half, local = lengths[:, :3] / 2, lengths[:, 3:]
    rotation = rotations.repeat(count, axis=0)
    centre = (rotation @ local[:, :, None])[:, :, 0]
    centre += positions.repeat(count, axis=0)
    first, cylinders = 0, []
    for table in tables:
        for index, tilt in table.tilts:
            rotation[first + index] = rotation[first + index].dot(tilt)
        cylinders += [first + index for index in table.round]
        first += len(table.masses)
    reach = (np.abs(rotation) @ half[:, :, None])[:, :, 0]
    for index in cylinders:
        own = half[index].tolist()
        reach[index] = [round_reach(row, own) for row in rotation[index].tolist()]
    mass = math.fsum(chain.from_iterable([table.masses for table in tables]))
    lower, upper = centre - reach, centre + reach
    return Boxes(count, rotation, centre, half, lower, upper, mass, tuple(cylinders))


@dataclass(frozen=True, slots=True)
class _Table:
    """Boxes of a shape in the frame of its part.

    Attributes:
        lengths: (B, 6) size, then centre [m].
        masses: mass of each box [kg].
        tilts: index and (3, 3) rotation of each box that is rotated in its part.
        round: indices of the cylinders.
    """

    lengths: Floats
    masses: list[float]
    tilts: list[tuple[int, Floats]]
    round: list[int]


@lru_cache(maxsize=1024)
def _table(shape: Shape) -> _Table:
    boxes = shape.boxes
    return _Table(
        np.array([box.size + box.position for box in boxes]).reshape(-1, 6),
        [box.mass for box in boxes],
        [
            (index, np.array(box.rotation))
            for index, box in enumerate(boxes)
            if box.rotation is not IDENTITY
        ],
        [index for index, box in enumerate(boxes) if box.is_round],
    )


def bounding_box(boxes: Boxes) -> tuple[Vector, Vector]:
    """Return the lower and upper corner of the axis-aligned hull [m], core frame."""
    lower_x, lower_y, lower_z = np.minimum.reduce(boxes.lower).tolist()
    upper_x, upper_y, upper_z = np.maximum.reduce(boxes.upper).tolist()
    return (lower_x, lower_y, lower_z), (upper_x, upper_y, upper_z)
