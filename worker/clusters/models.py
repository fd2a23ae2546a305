"""Engine models of an arena: one per robot at birth, shared ones on demand.

A few spheres, each fixed to one body, cover a robot's boxes, and the boxes around its
cylinders. With bounds that hold at any joint angle they give a lower bound on the
distance of two robots.
"""

import math
from collections import OrderedDict
from collections.abc import Sequence
from functools import partial
from itertools import product

import mujoco
import numpy as np
import numpy.typing as npt
from msgspec import Struct
from msgspec.structs import replace

from schema.experiment.document import body_space
from schema.experiment.scenery import refuse_objects
from schema.experiment.settings import ArenaSettings
from schema.mjcf.footing import footprint, standing_height
from schema.mjcf.model import add_walls, ring_wall, robot_spec, shared_model, solo_spec
from schema.robot.ids import BirthId
from schema.robot.robot import Robot
from schema.robot.trace import Floats
from worker.clusters.cluster import Cluster
from worker.robot.brains import controls_of
from worker.robot.recording import Channels

CACHE_SIZE = 64
"""Shared clusters that are cached in case their members meet again."""
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


class BoundingSpheres(Struct, frozen=True):
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


class Body(Struct, frozen=True):
    """Engine models of one robot.

    Attributes:
        robot: its parts, and its brain at birth or in the snapshot.
        solo: the cluster in which it is alone.
    """

    robot: Robot
    bounds: BoundingSpheres
    solo: Cluster
    channels: Channels


class ModelCache:
    """Compiles the models of one arena and caches shared clusters.

    Attributes:
        settings: of the arena.
        present: the settings at the present step, if some of them change.
    """

    def __init__(self, settings: ArenaSettings) -> None:
        """Initialise an empty cache.

        Raises:
            ExperimentError: scenery that is invalid, or has objects that move.
        """
        refuse_objects(settings.environment, settings.simulation)
        self.settings = self.present = settings
        self._simulation = replace(settings.simulation, drop_m=settings.arena.drop_m)
        self.controls = controls_of(settings)
        self._types = body_space(settings.space)
        self._furnish = partial(add_walls, walls=ring_wall(settings.arena))
        self._clusters: OrderedDict[tuple[BirthId, ...], Cluster] = OrderedDict()
        self._specs: dict[BirthId, mujoco.MjSpec] = {}

    def body(self, birth: BirthId, robot: Robot) -> Body:
        """Return a robot's models; its state is at the origin, at drop height.

        Raises:
            ValueError: the engine cannot build it.
            ExperimentError: a sensor that has no stimulus in the arena.
        """
        model = solo_spec(
            robot,
            self._types,
            self._simulation,
            self.settings.environment,
            furnish=self._furnish,
        ).compile()
        solo = Cluster((birth,), {"": robot}, model, self.settings)
        if self.settings.changes:
            solo.change(self.present)
        channels = Channels(solo.views[0], self.present)
        return Body(robot, bounding_spheres(model), solo, channels)

    def height(self, body: Body, place: tuple[float, float], heading: float) -> float:
        """Return the height of a robot's core when the arena drops it [m].

        The place is that of the core's centre, world frame [m]; the heading is the
        rotation about z [rad].
        """
        environment, model = self.settings.environment, body.solo.model
        if environment.is_even:
            return float(model.qpos0[2])
        boxes = footprint(model)
        return self._simulation.drop_m + standing_height(
            boxes, self._simulation, environment, place, heading
        )

    def cluster(self, births: tuple[BirthId, ...], bodies: Sequence[Body]) -> Cluster:
        """Return the cluster of some robots, in its initial state."""
        if len(births) == 1:
            found = bodies[0].solo
        elif births in self._clusters:
            self._clusters.move_to_end(births)
            found = self._clusters[births]
        else:
            found = self._shared(births, bodies)
            self._clusters[births] = found
            if len(self._clusters) > CACHE_SIZE:
                self._clusters.popitem(last=False)
        if self.settings.changes:
            # It may be older than the last change.
            found.change(self.present)
        found.reset()
        return found

    def forget(self, birth: BirthId) -> None:
        """Drop all models of a robot that has died."""
        self._specs.pop(birth, None)
        for members in [key for key in self._clusters if birth in key]:
            del self._clusters[members]

    def _shared(self, births: tuple[BirthId, ...], bodies: Sequence[Body]) -> Cluster:
        specs: list[tuple[str, mujoco.MjSpec]] = []
        robots: dict[str, Robot] = {}
        for birth, body in zip(births, bodies, strict=True):
            prefix = f"{birth.island}.{birth.number}/"
            robot = robots[prefix] = body.robot
            if birth not in self._specs:
                spec = robot_spec(robot, self._types, self._simulation).spec
                self._specs[birth] = spec
            specs.append((prefix, self._specs[birth]))
        model = shared_model(
            specs, self._simulation, self.settings.environment, furnish=self._furnish
        )
        return Cluster(births, robots, model, self.settings)


def bounding_spheres(model: mujoco.MjModel) -> BoundingSpheres:
    """Return the bounds of the one robot of a model; static geoms do not count."""
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
