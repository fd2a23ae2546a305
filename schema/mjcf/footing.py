"""How high a robot stands where the ground is not even.

Each box of a robot is seen as a column that goes up from its lowest point: lifted
until no column has anything of the ground in it, the robot is above all that stands
below it, and inside of nothing. So whoever is born where an obstacle is, is born on
top of that.
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
from schema.robot.results import Floats

_FINE_M = 1e-5
"""A robot stands less than twice this above an obstacle [m]."""
_TOUCH_M = 1e-6
"""What is no deeper in a column only touches it [m]."""
_ROBOTS = 1
"""The bit by which robots collide."""
_LEVEL = 0.9
"""Rise per length of an axis that is taken for upright."""
_ABOVE_M = 0.1
"""So far beyond an obstacle columns go."""


@dataclass(frozen=True, slots=True)
class Footprint:
    """The boxes of a robot at neutral pose, in the core's frame, as upright columns.

    Attributes:
        centres: (N, 3) [m].
        turns: (N,) of the columns about z [rad].
        halves: (N, 3) half of the boxes' extents along the columns' axes [m].
    """

    centres: Floats
    turns: Floats
    halves: Floats


def footprint(model: mujoco.MjModel) -> Footprint:
    """Return the boxes of the one robot of a model; static geoms do not count."""
    data = mujoco.MjData(model)
    data.qpos[:7] = 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0
    mujoco.mj_kinematics(model, data)
    own = model.geom_bodyid > 0
    axes = data.geom_xmat[own].reshape(-1, 3, 3)
    # Along an axis of the box that is not upright: what lies level fits exactly.
    is_level = np.abs(axes[:, 2, 0]) < _LEVEL
    along = np.where(is_level[:, None], axes[:, :, 0], axes[:, :, 1])
    turns = np.arctan2(along[:, 1], along[:, 0])
    level = _turned(axes, -turns)
    halves = (np.abs(level) @ model.geom_size[own][:, :, None])[:, :, 0]
    return Footprint(data.geom_xpos[own], turns, halves)


def standing_height(
    boxes: Footprint,
    simulation: Simulation,
    environment: Environment,
    place: tuple[float, float],
    heading: float,
) -> float:
    """Return how high a robot's core is when it stands on what is below it [m].

    Args:
        boxes: the robot's.
        simulation: the world's numbers.
        environment: what it stands in.
        place: of the core's centre in the ground plane, world frame [m].
        heading: turn about z [rad].
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
            obstacles.stand(spot, turn, half[:2])
            height = obstacles.cleared(bottom, height)
    return height


def _turned(vectors: Floats, angles: Floats) -> Floats:
    """Return (N, 3, K) vectors turned about z, by (N,) angles."""
    turned = vectors.copy()
    c, s = np.cos(angles)[:, None], np.sin(angles)[:, None]
    turned[:, 0] = c * vectors[:, 0] - s * vectors[:, 1]
    turned[:, 1] = s * vectors[:, 0] + c * vectors[:, 1]
    return turned


def _highest(
    environment: Environment, spots: Floats, turns: Floats, halves: Floats
) -> Floats:
    """Return the highest of rough ground below rectangles, (N,) [m].

    Patches are flat triangles between their nodes, so it is a node's height: of all
    patches that a rectangle touches.

    Args:
        environment: with roughness.
        spots: (N, 2) middles of the rectangles [m].
        turns: (N,) of them [rad].
        halves: (N, 2) of their lengths [m].
    """
    c, s = np.abs(np.cos(turns))[:, None], np.abs(np.sin(turns))[:, None]
    reaches = c * halves + s * halves[:, ::-1]
    shares, rim = relief(environment), 2 * environment.patches
    extent, patch = environment.extent_m, environment.patch_m
    tops = np.zeros(len(spots))
    lows = np.floor((spots - reaches + extent) / patch).astype(int)
    highs = np.ceil((spots + reaches + extent) / patch).astype(int)
    # Beyond the rim it is as low as at the rim.
    lows, highs = np.clip(lows, 0, rim), np.clip(highs, 0, rim) + 1
    for number, ((west, south), (east, north)) in enumerate(
        zip(lows.tolist(), highs.tolist(), strict=True)
    ):
        tops[number] = shares[south:north, west:east].max()
    return environment.roughness_m * tops


@lru_cache(maxsize=16)
def _probe(scenery: str, simulation: Simulation) -> mujoco.MjModel:
    """Return scenery and, as its last geom, a box for a column; not to be changed."""
    spec = mujoco.MjSpec()
    add_scenery(spec, scenery, simulation)
    spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_BOX, size=(1.0, 1.0, 1.0))
    return spec.compile()


class _Obstacles:
    """Scenery, and a column that is tried against it."""

    def __init__(self, scenery: str, simulation: Simulation) -> None:
        """Set scenery up.

        Args:
            scenery: MJCF.
            simulation: the world's numbers.
        """
        # Of its own: the column changes.
        self._model = copy.copy(_probe(scenery, simulation))
        self._data = mujoco.MjData(self._model)
        mujoco.mj_kinematics(self._model, self._data)
        self._column = self._model.ngeom - 1
        model = self._model
        is_solid = (model.geom_contype | model.geom_conaffinity) & _ROBOTS
        self._solid = is_solid[: self._column].nonzero()[0]

    def stand(self, spot: Floats, turn: float, half: Floats) -> None:
        """Put the column somewhere.

        Args:
            spot: (2,) where its middle is [m].
            turn: about z [rad].
            half: (2,) of its lengths [m].
        """
        column, c, s = self._column, cos(turn), sin(turn)
        self._data.geom_xpos[column, :2] = spot
        self._data.geom_xmat[column] = c, -s, 0.0, s, c, 0.0, 0.0, 0.0, 1.0
        self._model.geom_size[column, :2] = half

    def cleared(self, bottom: float, height: float) -> float:
        """Return the least height at which the column has no scenery in it [m].

        Args:
            bottom: of the column, above the core [m].
            height: of the core, from which on [m].
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
        """Return whether the column, from there up, keeps off an obstacle."""
        model, data, column = self._model, self._data, self._column
        top += _ABOVE_M
        data.geom_xpos[column, 2] = 0.5 * (bottom + top)
        model.geom_size[column, 2] = 0.5 * (top - bottom)
        gap = mujoco.mj_geomDistance(model, data, column, obstacle, _FINE_M, None)
        return bool(gap > -_TOUCH_M)
