"""Plan of a robot: the outlines of its boxes, seen from above."""

from dataclasses import dataclass
from itertools import product

import numpy as np

from schema.parts import BodySpace, PartType
from schema.robot.frames import place_parts, shapes_of
from schema.robot.robot import Robot
from schema.robot.trace import Floats

CORE, RIGID, JOINT, MOTOR = "#111111", "#56616E", "#E6A700", "#D5480B"
"""Colours of the core, of parts without a joint, with one, and with a motor."""
_LEAST_M = 0.25
"""Least width of what is shown: smaller robots look small [m]."""
_CORNERS = np.array(list(product((-0.5, 0.5), repeat=3)))


@dataclass(frozen=True, slots=True)
class Outline:
    """Convex outline of a box.

    Attributes:
        corners: (N, 2), N >= 3, from -0.5 to 0.5; the plan's middle is at 0.
        colour: of its part.
    """

    corners: Floats
    colour: str


def plan(robot: Robot, space: BodySpace) -> list[Outline]:
    """Return the outlines of all boxes, joints at 0, the lowest first.

    They fill a square of 1 by 1, as large as possible; x and y are the core's.
    """
    shapes = shapes_of(robot, space)
    frames = zip(*place_parts(robot, shapes), strict=True)
    found: list[tuple[float, Floats, str]] = []
    for part, shape, (turn, at) in zip(robot.parts, shapes, frames, strict=True):
        colour = _colour(space[part.kind])
        for box in shape.boxes:
            corners = (_CORNERS * box.size) @ np.array(box.rotation).T + box.position
            placed = corners @ turn.T + at
            seen = placed[:, :2]
            found.append((float(placed[:, 2].max()), _hull(seen), colour))
    every = np.concatenate([corners for _, corners, _ in found])
    low, high = every.min(axis=0), every.max(axis=0)
    extent, middle = max(_LEAST_M, *(high - low).tolist()), 0.5 * (low + high)
    found.sort(key=lambda each: each[0])
    return [
        Outline((corners - middle) / extent, colour) for _, corners, colour in found
    ]


def _colour(kind: PartType) -> str:
    if kind.is_root:
        return CORE
    if kind.motor is not None:
        return MOTOR
    return JOINT if kind.shape(_defaults(kind)).joint is not None else RIGID


def _defaults(kind: PartType) -> tuple[float, ...]:
    return tuple(parameter.default for parameter in kind.parameters)


def _hull(points: Floats) -> Floats:
    """Return the corners of the convex hull of points, (N, 2), anticlockwise.

    Source: Andrew 1979, the monotone chain.
    """
    ordered = sorted(map(tuple, points.tolist()))
    corners: list[tuple[float, float]] = []
    for some in (ordered, ordered[::-1]):
        chain: list[tuple[float, float]] = []
        for point in some:
            while len(chain) > 1 and _turn(chain[-2], chain[-1], point) <= 0.0:
                chain.pop()
            chain.append(point)
        corners += chain[:-1]
    return np.array(corners)


def _turn(
    first: tuple[float, float], second: tuple[float, float], third: tuple[float, float]
) -> float:
    """Return a number that is positive if a path turns left."""
    (x, y), (x_2, y_2), (x_3, y_3) = first, second, third
    return (x_2 - x) * (y_3 - y) - (y_2 - y) * (x_3 - x)
