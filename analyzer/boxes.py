"""A body as boxes in the core's frame, joints at zero."""

import math
from dataclasses import dataclass
from itertools import chain

import numpy as np
import numpy.typing as npt

from schema.assembly import place_parts
from schema.evaluation import Floats
from schema.parts import IDENTITY, BodySpace, Vector
from schema.robot import Robot

Indices = npt.NDArray[np.intp]


@dataclass(frozen=True, slots=True)
class Boxes:
    """All boxes of a body, in the core's frame.

    Attributes:
        part: (N,) index of the part that each box belongs to, ascending.
        rotation: (N, 3, 3) box frame to core frame.
        centre: (N, 3) [m].
        half: (N, 3) half of the lengths along the box's own axes [m].
        reach: (N, 3) half of the lengths of its axis-aligned hull [m].
        mass: of all boxes together [kg].
    """

    part: Indices
    rotation: Floats
    centre: Floats
    half: Floats
    reach: Floats
    mass: float


def place_boxes(robot: Robot, space: BodySpace) -> Boxes:
    """Return where every box of a checked robot sits.

    Args:
        robot: a checked robot.
        space: its part types.

    Returns:
        Its boxes, part after part, in the order of each part's shape.
    """
    rotations, positions = place_parts(robot, space)
    shapes = [space[part.kind].shape(part.parameters).boxes for part in robot.parts]
    boxes = list(chain.from_iterable(shapes))
    part = np.array([index for index, each in enumerate(shapes) for _ in each])
    half = np.array([box.size for box in boxes]) / 2
    local = np.array([box.position for box in boxes])
    rotation = rotations[part]
    centre = positions[part] + (rotation @ local[:, :, None])[:, :, 0]
    tilted = [i for i, box in enumerate(boxes) if box.rotation is not IDENTITY]
    if tilted:
        tilts = np.array([boxes[index].rotation for index in tilted])
        rotation[tilted] = rotation[tilted] @ tilts
    reach = (np.abs(rotation) @ half[:, :, None])[:, :, 0]
    mass = math.fsum(box.mass for box in boxes)
    return Boxes(part, rotation, centre, half, reach, mass)


def bounding_box(boxes: Boxes) -> tuple[Vector, Vector]:
    """Return the lower and upper corner of the axis-aligned hull [m], core frame."""
    lower_x, lower_y, lower_z = (boxes.centre - boxes.reach).min(axis=0).tolist()
    upper_x, upper_y, upper_z = (boxes.centre + boxes.reach).max(axis=0).tolist()
    return (lower_x, lower_y, lower_z), (upper_x, upper_y, upper_z)
