"""Plan of a robot: the outlines of its boxes, seen from above."""

from dataclasses import dataclass

import numpy as np

from schema.parts import BodySpace, PartType, Shape
from schema.robot.frames import place_parts, shapes_of
from schema.robot.robot import Robot
from schema.robot.trace import Floats

CORE, RIGID, JOINT, MOTOR = "#111111", "#56616E", "#E6A700", "#D5480B"
"""Colours of the core, of parts without a joint, with one, and with a motor."""
_LEAST_M = 0.25
"""Least width of what is shown: smaller robots look small [m]."""


@dataclass(frozen=True, slots=True)
class Outline:
    """Outline of a box: corners (6, 2), from -0.5 to 0.5, and colour of its part."""

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
        colour = _colour(space[part.kind], shape)
        for box in shape.boxes:
            edges = (turn @ (np.array(box.rotation) * box.size)).T
            middle = turn @ box.position + at
            top = float(middle[2] + 0.5 * np.abs(edges[:, 2]).sum())
            found.append((top, _outline(middle[:2], edges[:, :2]), colour))
    every = np.concatenate([corners for _, corners, _ in found])
    low, high = every.min(axis=0), every.max(axis=0)
    extent, middle = max(_LEAST_M, *(high - low).tolist()), 0.5 * (low + high)
    found.sort(key=lambda each: each[0])
    return [
        Outline((corners - middle) / extent, colour) for _, corners, colour in found
    ]


def _colour(kind: PartType, shape: Shape) -> str:
    if kind.is_root:
        return CORE
    if kind.motor is not None:
        return MOTOR
    return RIGID if shape.joint is None else JOINT


def _outline(middle: Floats, edges: Floats) -> Floats:
    """Return the outline of a box seen from above, (6, 2); its edges are (3, 2)."""
    is_down = (edges[:, 1] < 0) | ((edges[:, 1] == 0) & (edges[:, 0] < 0))
    edges = np.where(is_down[:, np.newaxis], -edges, edges)
    # Around a box seen from above each of its edges is met twice, by direction.
    order = np.argsort(np.arctan2(edges[:, 1], edges[:, 0]), kind="stable")
    half = np.cumsum(edges[order], axis=0) - 0.5 * edges.sum(axis=0)
    corners: Floats = middle + np.concatenate([half, -half])
    return corners
