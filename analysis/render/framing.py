"""Camera places from which a whole robot can be seen in all of its poses."""

import math

import numpy as np
import numpy.typing as npt

Numbers = npt.NDArray[np.float64]


def view_axes(azimuth: float, elevation: float) -> Numbers:
    """Return the directions right, up and towards a camera, (3, 3), of a view [rad]."""
    flat = math.cos(elevation)
    forward = np.array(
        [flat * math.cos(azimuth), flat * math.sin(azimuth), math.sin(elevation)]
    )
    right = np.array([math.sin(azimuth), -math.cos(azimuth), 0.0])
    return np.stack([right, np.cross(right, forward), -forward])


def framed(
    centres: Numbers,
    radii: Numbers,
    azimuth: float,
    elevation: float,
    tangents: tuple[float, float, float],
) -> tuple[Numbers, float]:
    """Return the point that a camera looks at, and its distance [m], to see spheres.

    Args:
        centres: (N, 3) centres of the spheres, world frame [m].
        radii: (N,) their radii [m].
        azimuth: direction of the camera's view, as MuJoCo's [rad].
        elevation: the same.
        tangents: of the angles between the view and the edges of the picture: above,
            below, and at each side.
    """
    axes = view_axes(azimuth, elevation)
    places = centres @ axes.T
    middle = 0.5 * (places.min(axis=0) + places.max(axis=0))
    across, up, towards = (places - middle).T
    angles = np.arctan(tangents)
    sides = zip((up, -up, np.abs(across)), angles, strict=True)
    distances = [
        towards + (beyond * np.cos(angle) + radii) / np.sin(angle)
        for beyond, angle in sides
    ]
    return middle @ axes, float(np.max(distances))
