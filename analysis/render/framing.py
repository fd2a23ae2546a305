"""Camera places from which a whole robot can be seen in all of its poses."""

import math

import numpy as np
import numpy.typing as npt

Numbers = npt.NDArray[np.float64]


def framed(
    centres: Numbers,
    radii: Numbers,
    azimuth: float,
    elevation: float,
    tangents: tuple[float, float, float],
) -> tuple[Numbers, float]:
    """Return the point that a camera looks at, and its distance, to see all spheres.

    Args:
        centres: (N, 3) centres of spheres, world frame [m].
        radii: (N,) their radii [m].
        azimuth: direction of the camera's view, as MuJoCo's [rad].
        elevation: the same.
        tangents: of the angles between the view and the edges of the picture: above,
            below, and at each side.

    Returns:
        The point (3,) [m], and the distance of the camera from it [m].
    """
    flat = math.cos(elevation)
    forward = np.array(
        [flat * math.cos(azimuth), flat * math.sin(azimuth), math.sin(elevation)]
    )
    right = np.array([math.sin(azimuth), -math.cos(azimuth), 0.0])
    axes = np.stack([right, np.cross(right, forward), -forward])
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
