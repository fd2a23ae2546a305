"""How far a robot reaches and how fast any point of it may move.

A robot's boxes are covered by few spheres, each fixed to one body. They, and
bounds that hold at any joint angle, tell from below how far two robots are apart.
"""

import math
from dataclasses import dataclass
from itertools import product

import mujoco
import numpy as np
import numpy.typing as npt

from schema.robot.results import Floats

Indices = npt.NDArray[np.intp]

SLENDERNESS = 1.6
"""A box is cut where it is longer than this many times its middle width."""
GROWTH = 1.2
"""Two spheres become one that is at most this many times the larger of them."""

_Ball = tuple[Floats, float]
"""Centre and radius [m]."""


@dataclass(frozen=True, slots=True)
class BoundingSpheres:
    """What bounds one robot, whatever its joints do.

    Attributes:
        bodies: (B,) body of each sphere, counted from the robot's first.
        centres: (B, 9) in the frames of their bodies, thrice over, to be
            multiplied with the rows of rotations [m].
        radii: (B,) [m].
        hulls: (N, 4) centres, in the frames of its N bodies, and radii of spheres
            that hold all spheres of a body each [m].
        weights: (V,) of the absolute velocities of its degrees of freedom in a
            bound on the speed of its fastest point.
    """

    bodies: Indices
    centres: Floats
    radii: Floats
    hulls: Floats
    weights: Floats


def bounding_spheres(model: mujoco.MjModel) -> BoundingSpheres:
    """Return what bounds the one robot of a model.

    Args:
        model: as ``schema.mjcf.model.solo_model`` makes it; static geoms do not count.
    """
    root = int(model.jnt_bodyid[0])
    covers: list[list[_Ball]] = []
    for body in range(root, model.nbody):
        first, count = int(model.body_geomadr[body]), int(model.body_geomnum[body])
        balls: list[_Ball] = []
        for geom in range(first, first + count):
            balls += _cut(model, geom)
        covers.append(_merged(balls))
    # Of each body: how far anything beyond its joint may be from its origin.
    far = [max((_length(c) + r for c, r in cover), default=0.0) for cover in covers]
    for body in range(model.nbody - 1, root, -1):
        parent = int(model.body_parentid[body]) - root
        arm = _length(model.body_pos[body])
        far[parent] = max(far[parent], arm + far[body - root])
    weights = np.empty(model.nv)
    weights[:3], weights[3:6] = 1.0, far[0]
    for joint in range(1, model.njnt):
        body = int(model.jnt_bodyid[joint]) - root
        weights[int(model.jnt_dofadr[joint])] = far[body]
    counts = [len(cover) for cover in covers]
    balls = [ball for cover in covers for ball in cover]
    return BoundingSpheres(
        np.repeat(np.arange(len(covers)), counts),
        np.tile([centre for centre, _ in balls], 3),
        np.array([radius for _, radius in balls]),
        np.array([_hull(cover) for cover in covers]),
        weights,
    )


def _hull(cover: list[_Ball]) -> list[float]:
    """Return the centre and the radius of a sphere that holds some spheres."""
    if not cover:
        return [0.0, 0.0, 0.0, 0.0]
    centres = np.array([centre for centre, _ in cover])
    centre = 0.5 * (centres.min(axis=0) + centres.max(axis=0))
    radius = max(_length(c - centre) + r for c, r in cover)
    return [*centre.tolist(), radius]


def _cut(model: mujoco.MjModel, geom: int) -> list[_Ball]:
    """Return spheres that cover a box, in its body's frame."""
    size = 2.0 * model.geom_size[geom]
    middle = sorted(size.tolist())[1]
    pieces = [max(1, math.ceil(edge / (SLENDERNESS * middle))) for edge in size]
    if min(pieces) == max(pieces) == 1 and float(np.min(size)) * 2 <= middle * 1.01:
        # A flat box: its width is what makes its sphere large.
        is_large = middle > LARGE
        pieces = [2 if is_large and edge >= middle else 1 for edge in size]
    cell = size / pieces
    rotation = np.empty(9)
    mujoco.mju_quat2Mat(rotation, model.geom_quat[geom])
    radius = 0.5 * _length(cell)
    found = []
    for index in product(*map(range, pieces)):
        local = (np.array(index) + 0.5) * cell - 0.5 * size
        found.append((model.geom_pos[geom] + rotation.reshape(3, 3) @ local, radius))
    return found


LARGE = 0.06
"""A flat box wider than this is cut in four [m]."""


def _merged(balls: list[_Ball]) -> list[_Ball]:
    """Return fewer spheres that cover the same, hardly larger ones."""
    left = sorted(balls, key=lambda ball: -ball[1])
    kept: list[_Ball] = []
    while left:
        centre, radius = left.pop(0)
        largest = GROWTH * radius
        rest: list[_Ball] = []
        for other, other_radius in left:
            apart = _length(other - centre)
            if apart + other_radius <= radius:
                continue
            joint = 0.5 * (apart + radius + other_radius)
            if joint <= largest:
                centre = centre + (other - centre) * ((joint - radius) / apart)
                radius = joint
            else:
                rest.append((other, other_radius))
        kept.append((centre, radius))
        left = rest
    return kept


def _length(vector: Floats) -> float:
    """Return what ``np.linalg.norm`` does, sooner."""
    return math.sqrt(vector.dot(vector))
