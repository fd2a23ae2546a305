"""Boxes and cylinders of a body in the core's frame, joints at zero."""

import math
from dataclasses import dataclass
from itertools import chain

import numpy as np
import numpy.typing as npt

from schema.parts import IDENTITY, BodySpace, Vector
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
    boxes = [box for shape in shapes for box in shape.boxes]
    count = np.array([len(shape.boxes) for shape in shapes])
    rows = chain.from_iterable([box.size + box.position for box in boxes])
    lengths = np.fromiter(rows, float).reshape(-1, 6)
    half, local = lengths[:, :3] / 2, lengths[:, 3:]
    rotation = rotations.repeat(count, axis=0)
    centre = (rotation @ local[:, :, None])[:, :, 0]
    centre += positions.repeat(count, axis=0)
    for index, box in enumerate(boxes):
        if box.rotation is not IDENTITY:
            rotation[index] = rotation[index].dot(box.rotation)
    reach = (np.abs(rotation) @ half[:, :, None])[:, :, 0]
    cylinders = tuple([index for index, box in enumerate(boxes) if box.is_round])
    for index in cylinders:
        own = half[index].tolist()
        reach[index] = [round_reach(row, own) for row in rotation[index].tolist()]
    mass = math.fsum([box.mass for box in boxes])
    lower, upper = centre - reach, centre + reach
    return Boxes(count, rotation, centre, half, lower, upper, mass, cylinders)


def bounding_box(boxes: Boxes) -> tuple[Vector, Vector]:
    """Return the lower and upper corner of the axis-aligned hull [m], core frame."""
    lower_x, lower_y, lower_z = np.minimum.reduce(boxes.lower).tolist()
    upper_x, upper_y, upper_z = np.maximum.reduce(boxes.upper).tolist()
    return (lower_x, lower_y, lower_z), (upper_x, upper_y, upper_z)
