"""Camera places from which a whole robot can be seen in all of its poses."""

import math

import numpy as np

from schema.robot.trace import Floats

_FILLED = 0.88
"""Share of a picture's width or height that is filled."""
_ROUNDS = 5
"""Near points are further from the middle than far ones: it is found step by step."""


def view_axes(azimuth: float, elevation: float) -> Floats:
    """Return the directions right, up and towards a camera, (3, 3), of a view [rad]."""
    flat = math.cos(elevation)
    forward = np.array(
        [flat * math.cos(azimuth), flat * math.sin(azimuth), math.sin(elevation)]
    )
    right = np.array([math.sin(azimuth), -math.cos(azimuth), 0.0])
    return np.stack([right, np.cross(right, forward), -forward])


def framed(
    points: Floats, azimuth: float, elevation: float, tangents: tuple[float, float]
) -> tuple[Floats, float]:
    """Return the point that a camera looks at, and its distance [m], to see points.

    The points are in the middle of the picture and fill it but for a rim.

    Args:
        points: (N, 3), world frame [m].
        azimuth: direction of the camera's view, as MuJoCo's [rad].
        elevation: the same.
        tangents: of the angles between the view and the edges of the picture: above
            and below, and at each side.
    """
    axes = view_axes(azimuth, elevation)
    places = points @ axes.T
    middle = 0.5 * (places.min(axis=0) + places.max(axis=0))
    edges = _FILLED * np.array([tangents[1], tangents[0]])
    for _ in range(_ROUNDS):
        offsets, towards = (places - middle)[:, :2], (places - middle)[:, 2:]
        distance = float((towards + np.abs(offsets) / edges).max())
        seen = offsets / (distance - towards)
        middle[:2] += 0.5 * distance * (seen.min(axis=0) + seen.max(axis=0))
    return middle @ axes, distance
