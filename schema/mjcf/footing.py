"""Height at which a robot stands on rough ground and scenery.

Each box or cylinder of a robot is replaced by a column that extends upwards from its
lowest point. The robot is lifted until no column intersects ground or scenery, so a
robot that is born at an obstacle stands on top of it.
"""

import copy
from dataclasses import dataclass
from functools import lru_cache
from math import cos, sin

import mujoco
import numpy as np

from schema.experiment.document import Simulation
from schema.experiment.environment import Environment, relief
from schema.experiment.scenery import add_scenery
from schema.robot.frames import round_reach
from schema.robot.trace import Floats

_FINE_M = 1e-5
"""A robot stands less than twice this distance above an obstacle [m]."""
_TOUCH_M = 1e-6
"""Penetration depth that counts as touching [m]."""
_ROBOTS = 1
"""Collision bit of robots."""
_LEVEL = 0.9
"""z component from which a unit axis counts as upright."""
_ABOVE_M = 0.1
"""Height by which columns extend beyond an obstacle [m]."""


@dataclass(frozen=True, slots=True)
class Footprint:
    """Boxes of a robot at neutral pose as upright columns, about the core's centre.

    The column of a cylinder encloses it.

    Attributes:
        centres: (N, 3) [m].
        turns: (N,) rotations of the columns about z [rad].
        halves: (N, 3) half extents of the boxes along the axes of the columns [m].
    """

    centres: Floats
    turns: Floats
    halves: Floats


def footprint(model: mujoco.MjModel, attitude: Floats | None = None) -> Footprint:
    """Return the boxes of the only robot of a model, without static geoms.

    ``attitude`` of the core is a unit quaternion (4,) w, x, y, z; None is level.
    """
    data = mujoco.MjData(model)
    data.qpos[:7] = 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0
    if attitude is not None:
        data.qpos[3:7] = attitude
    mujoco.mj_kinematics(model, data)
    own = model.geom_bodyid > 0
    axes = data.geom_xmat[own].reshape(-1, 3, 3)
    # Along a box axis that is not upright, so that the column of a level box is exact.
    is_level = np.abs(axes[:, 2, 0]) < _LEVEL
    along = np.where(is_level[:, None], axes[:, :, 0], axes[:, :, 1])
    turns = np.arctan2(along[:, 1], along[:, 0])
    level = _turned(axes, -turns)
    halves = (np.abs(level) @ model.geom_size[own][:, :, None])[:, :, 0]
    for index in np.flatnonzero(model.geom_type[own] == mujoco.mjtGeom.mjGEOM_CYLINDER):
        radius, half, _ = model.geom_size[own][index].tolist()
        rows: list[list[float]] = level[index].tolist()
        halves[index] = [round_reach(row, (radius, radius, half)) for row in rows]
    return Footprint(data.geom_xpos[own], turns, halves)


def standing_height(
    boxes: Footprint,
    simulation: Simulation,
    environment: Environment,
    place: tuple[float, float],
    heading: float,
) -> float:
    """Return the height of the core [m] of a robot that stands at a place.

    The place is that of the core's centre in the ground plane [m], the heading a
    rotation about z [rad]; both in the world frame.
    """
    around = np.full(len(boxes.turns), heading)
    spots = place + _turned(boxes.centres[:, :, None], around)[:, :2, 0]
    turns = boxes.turns + heading
    bottoms = boxes.centres[:, 2] - boxes.halves[:, 2]
    height = float(-bottoms.min())
    if environment.roughness_m:
        tops = _highest(environment, spots, turns, boxes.halves[:, :2])
        height = float((tops - bottoms).max())
    if environment.scenery:
        obstacles = _Obstacles(environment.scenery, simulation)
        columns = zip(spots, turns, boxes.halves, bottoms.tolist(), strict=True)
        for spot, turn, half, bottom in columns:
            obstacles.move(spot, turn, half[:2])
            height = obstacles.cleared(bottom, height)
    return height


def _turned(vectors: Floats, angles: Floats) -> Floats:
    """Return (N, 3, K) vectors rotated about z by (N,) angles."""
    turned = vectors.copy()
    c, s = np.cos(angles)[:, None], np.sin(angles)[:, None]
    turned[:, 0] = c * vectors[:, 0] - s * vectors[:, 1]
    turned[:, 1] = s * vectors[:, 0] + c * vectors[:, 1]
    return turned


def _highest(
    environment: Environment, spots: Floats, turns: Floats, halves: Floats
) -> Floats:
    """Return the greatest height of rough ground below rectangles, (N,) [m].

    Patches are flat triangles between nodes, so this is the height of a node of a
    patch that the rectangle touches.

    The rectangles have centres (N, 2) [m], turns (N,) [rad] and half lengths (N, 2)
    [m].
    """
    c, s = np.abs(np.cos(turns))[:, None], np.abs(np.sin(turns))[:, None]
    reaches = c * halves + s * halves[:, ::-1]
    shares, rim = relief(environment), 2 * environment.patches
    extent, patch = environment.extent_m, environment.patch_m
    tops = np.zeros(len(spots))
    lows = np.floor((spots - reaches + extent) / patch).astype(int)
    highs = np.ceil((spots + reaches + extent) / patch).astype(int)
    # Beyond the rim the height is that of the rim.
    lows, highs = np.clip(lows, 0, rim), np.clip(highs, 0, rim) + 1
    for number, ((west, south), (east, north)) in enumerate(
        zip(lows.tolist(), highs.tolist(), strict=True)
    ):
        tops[number] = shares[south:north, west:east].max()
    return environment.roughness_m * tops


@lru_cache(maxsize=16)
def _probe(scenery: str, simulation: Simulation) -> mujoco.MjModel:
    """Return scenery with a box named ``column``; do not change it."""
    spec = mujoco.MjSpec()
    add_scenery(spec, scenery, simulation)
    spec.worldbody.add_geom(
        name="column", type=mujoco.mjtGeom.mjGEOM_BOX, size=(1.0, 1.0, 1.0)
    )
    return spec.compile()


class _Obstacles:
    """Scenery, with a column to test for intersection."""

    def __init__(self, scenery: str, simulation: Simulation) -> None:
        """Initialise the model of the scenery."""
        # A copy, because the column changes.
        self._model = copy.copy(_probe(scenery, simulation))
        self._data = mujoco.MjData(self._model)
        mujoco.mj_kinematics(self._model, self._data)
        self._column = int(self._model.geom("column").id)
        model = self._model
        is_solid = (model.geom_contype | model.geom_conaffinity) & _ROBOTS
        is_solid[self._column] = 0
        self._solid = is_solid.nonzero()[0]

    def move(self, spot: Floats, turn: float, half: Floats) -> None:
        """Move the column to (2,) [m], turned about z [rad]; half lengths (2,) [m]."""
        column, c, s = self._column, cos(turn), sin(turn)
        self._data.geom_xpos[column, :2] = spot
        self._data.geom_xmat[column] = c, -s, 0.0, s, c, 0.0, 0.0, 0.0, 1.0
        self._model.geom_size[column, :2] = half

    def cleared(self, bottom: float, height: float) -> float:
        """Return the least height of the core, from one on, with a clear column.

        ``bottom`` is that of the column, relative to the core; all in m.
        """
        places, radii = self._data.geom_xpos, self._model.geom_rbound
        apart = places[self._solid, :2] - places[self._column, :2]
        reach = np.linalg.norm(self._model.geom_size[self._column, :2])
        near = np.linalg.norm(apart, axis=1) < radii[self._solid] + reach
        for obstacle in self._solid[near].tolist():
            top = float(places[obstacle, 2] + radii[obstacle])
            low, high = height, top - bottom
            if low >= high or self._is_clear(obstacle, bottom + low, top):
                continue
            while high - low > _FINE_M:
                middle = 0.5 * (low + high)
                if self._is_clear(obstacle, bottom + middle, top):
                    high = middle
                else:
                    low = middle
            height = high + _FINE_M
        return height

    def _is_clear(self, obstacle: int, bottom: float, top: float) -> bool:
        """Return whether the column above ``bottom`` does not intersect an obstacle."""
        model, data, column = self._model, self._data, self._column
        top += _ABOVE_M
        data.geom_xpos[column, 2] = 0.5 * (bottom + top)
        model.geom_size[column, 2] = 0.5 * (top - bottom)
        gap = mujoco.mj_geomDistance(model, data, column, obstacle, _FINE_M, None)
        return bool(gap > -_TOUCH_M)
