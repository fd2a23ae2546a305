"""Bounding spheres of a robot and bounds on the speed of its points.

A few spheres, each fixed to one body, cover a robot's boxes, and the boxes around its
cylinders. With bounds that hold at any joint angle they give a lower bound on the
distance of two robots.
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
"""Boxes longer than this many times their middle width are divided."""
GROWTH = 1.2
"""Two spheres merge into one of at most this many times the larger radius."""
WIDE_M = 0.06
"""Flat boxes wider than this are divided in four [m]."""

OVERSHOOT = 1.1
"""Greatest displacement of a slider, as a share of its soft limit."""

_Sphere = tuple[Floats, float]
"""Centre and radius [m]."""


@dataclass(frozen=True, slots=True)
class BoundingSpheres:
    """Bounds of one robot that hold at any joint angle.

    Attributes:
        bodies: (B,) body of each sphere, counted from the robot's first.
        centres: (B, 9) in the frames of their bodies, three copies each, to be
            multiplied by the rows of rotations [m].
        radii: (B,) [m].
        hulls: (N, 4) centre, in the body's frame, and radius of one sphere per body
            that contains all spheres of the body [m].
        weights: (V,) of the absolute velocities of its degrees of freedom in a
            bound on the speed of its fastest point.
    """

    bodies: Indices
    centres: Floats
    radii: Floats
    hulls: Floats
    weights: Floats


def bounding_spheres(model: mujoco.MjModel) -> BoundingSpheres:
    """Return the bounds of the one robot of a model.

    Args:
        model: from ``schema.mjcf.model.solo_spec``; static geoms do not count.
    """
    root = int(model.jnt_bodyid[0])
    covers: list[list[_Sphere]] = []
    for body in range(root, model.nbody):
        first, count = int(model.body_geomadr[body]), int(model.body_geomnum[body])
        spheres: list[_Sphere] = []
        for geom in range(first, first + count):
            spheres += _box_cover(model, geom)
        covers.append(_merged(spheres))
    # Greatest distance from each body's origin of anything beyond its joint.
    far = [max((_length(c) + r for c, r in cover), default=0.0) for cover in covers]
    for body in range(model.nbody - 1, root, -1):
        parent = int(model.body_parentid[body]) - root
        arm = _length(model.body_pos[body]) + _travel(model, body)
        far[parent] = max(far[parent], arm + far[body - root])
    weights = np.empty(model.nv)
    weights[:3], weights[3:6] = 1.0, far[0]
    for joint in range(1, model.njnt):
        body = int(model.jnt_bodyid[joint]) - root
        is_slider = model.jnt_type[joint] == mujoco.mjtJoint.mjJNT_SLIDE
        weights[int(model.jnt_dofadr[joint])] = 1.0 if is_slider else far[body]
    counts = [len(cover) for cover in covers]
    spheres = [sphere for cover in covers for sphere in cover]
    return BoundingSpheres(
        np.repeat(np.arange(len(covers)), counts),
        np.tile([centre for centre, _ in spheres], 3),
        np.array([radius for _, radius in spheres]),
        np.array([_hull(cover) for cover in covers]),
        weights,
    )


def _travel(model: mujoco.MjModel, body: int) -> float:
    """Return how far a body's joint moves its origin, soft limit included [m]."""
    joint = int(model.body_jntadr[body])
    if model.jnt_type[joint] != mujoco.mjtJoint.mjJNT_SLIDE:
        return 0.0
    return OVERSHOOT * float(model.jnt_range[joint, 1])


def _hull(cover: list[_Sphere]) -> list[float]:
    """Return centre and radius of a sphere that contains some spheres."""
    if not cover:
        return [0.0, 0.0, 0.0, 0.0]
    centres = np.array([centre for centre, _ in cover])
    centre = 0.5 * (centres.min(axis=0) + centres.max(axis=0))
    radius = max(_length(c - centre) + r for c, r in cover)
    return [*centre.tolist(), radius]


def _box_cover(model: mujoco.MjModel, geom: int) -> list[_Sphere]:
    """Return spheres that cover a box or cylinder, in its body's frame."""
    size = 2.0 * model.geom_size[geom]
    if model.geom_type[geom] == mujoco.mjtGeom.mjGEOM_CYLINDER:
        size = size[[0, 0, 1]]
    middle = sorted(size.tolist())[1]
    pieces = [max(1, math.ceil(edge / (SLENDERNESS * middle))) for edge in size]
    if min(pieces) == max(pieces) == 1 and float(np.min(size)) * 2 <= middle * 1.01:
        # The width of a flat box determines the radius of its sphere.
        is_wide = middle > WIDE_M
        pieces = [2 if is_wide and edge >= middle else 1 for edge in size]
    cell = size / pieces
    rotation = np.empty(9)
    mujoco.mju_quat2Mat(rotation, model.geom_quat[geom])
    radius = 0.5 * _length(cell)
    found = []
    for index in product(*map(range, pieces)):
        local = (np.array(index) + 0.5) * cell - 0.5 * size
        found.append((model.geom_pos[geom] + rotation.reshape(3, 3) @ local, radius))
    return found


def _merged(spheres: list[_Sphere]) -> list[_Sphere]:
    """Return fewer, at most slightly larger spheres that cover the same space."""
    left = sorted(spheres, key=lambda sphere: -sphere[1])
    kept: list[_Sphere] = []
    while left:
        centre, radius = left.pop(0)
        largest = GROWTH * radius
        rest: list[_Sphere] = []
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
    """Return the norm; faster than ``np.linalg.norm`` for three numbers."""
    return math.sqrt(vector.dot(vector))
