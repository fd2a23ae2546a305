"""Turns in space as unit quaternions x, y, z, w, many at a time."""

import numpy as np

from schema.robot.results import Floats


def quaternion(matrix: Floats) -> Floats:
    """Return the unit quaternion x, y, z, w of a rotation matrix.

    Source: Bar-Itzhack 2000, New method for extracting the quaternion from a
    rotation matrix: the greatest eigenvector of a symmetric matrix.
    """
    (xx, xy, xz), (yx, yy, yz), (zx, zy, zz) = matrix.tolist()
    symmetric = [
        [xx - yy - zz, yx + xy, zx + xz, zy - yz],
        [yx + xy, yy - xx - zz, zy + yz, xz - zx],
        [zx + xz, zy + yz, zz - xx - yy, yx - xy],
        [zy - yz, xz - zx, yx - xy, xx + yy + zz],
    ]
    _, vectors = np.linalg.eigh(np.array(symmetric))
    greatest: Floats = vectors[:, -1]
    return greatest


def product(first: Floats, second: Floats) -> Floats:
    """Return the quaternions of one turn after another, x, y, z, w, broadcast."""
    vector, scalar = first[..., :3], first[..., 3:]
    other, rest = second[..., :3], second[..., 3:]
    return np.concatenate(
        [
            scalar * other + rest * vector + np.cross(vector, other),
            scalar * rest - (vector * other).sum(axis=-1, keepdims=True),
        ],
        axis=-1,
    )


def rotated(turns: Floats, points: Floats) -> Floats:
    """Return points turned by quaternions x, y, z, w, broadcast."""
    vector, scalar = turns[..., :3], turns[..., 3:]
    across = 2.0 * np.cross(vector, points)
    return points + scalar * across + np.cross(vector, across)
