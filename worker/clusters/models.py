"""Engine models of an arena: one per robot at birth, shared ones on demand."""

from collections import OrderedDict
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial

import mujoco
from msgspec.structs import replace

from schema.experiment.document import body_space
from schema.experiment.scenery import refuse_objects
from schema.experiment.settings import ArenaSettings
from schema.mjcf.footing import footprint, standing_height
from schema.mjcf.model import add_ring_wall, robot_spec, shared_model, solo_spec
from schema.robot.ids import BirthId
from schema.robot.robot import Robot
from worker.clusters.bounds import BoundingSpheres, bounding_spheres
from worker.clusters.cluster import Cluster, Member
from worker.robot.brains import controls_of
from worker.robot.recording import Channels

CACHE_SIZE = 64
"""Shared clusters that are cached in case their members meet again."""


@dataclass(frozen=True, slots=True)
class Body:
    """Engine models of one robot.

    Attributes:
        robot: its parts, and its brain at birth or in the snapshot.
        bounds: bounding spheres.
        solo: the cluster in which it is alone.
        channels: of its trace.
    """

    robot: Robot
    bounds: BoundingSpheres
    solo: Cluster
    channels: Channels


class ModelCache:
    """Compiles the models of one arena and caches shared clusters.

    Attributes:
        settings: of the arena.
        controls: brains of the arena.
    """

    def __init__(self, settings: ArenaSettings) -> None:
        """Initialise an empty cache.

        Raises:
            ExperimentError: scenery that is invalid, or has objects that move.
        """
        refuse_objects(settings.environment, settings.simulation)
        self.settings = settings
        self._simulation = replace(settings.simulation, drop_m=settings.arena.drop_m)
        self.controls = controls_of(settings)
        self._types = body_space(settings.space)
        self._furnish = partial(add_ring_wall, arena=settings.arena)
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
        solo = Cluster((birth,), [Member("", robot, model)], model, self.settings)
        channels = Channels(robot, model, self.settings)
        return Body(robot, bounding_spheres(model), solo, channels)

    def height(self, body: Body, place: tuple[float, float], heading: float) -> float:
        """Return the height of a robot's core when the arena drops it [m].

        Args:
            body: of the robot.
            place: of the core's centre in the ground plane, world frame [m].
            heading: rotation about z [rad].
        """
        environment, model = self.settings.environment, body.solo.model
        if environment.is_even:
            return float(model.qpos0[2])
        boxes = footprint(model)
        return self._simulation.drop_m + standing_height(
            boxes, self._simulation, environment, place, heading
        )

    def cluster(self, births: tuple[BirthId, ...], bodies: Sequence[Body]) -> Cluster:
        """Return the cluster of some robots, in its initial state.

        Args:
            births: of the robots, ascending.
            bodies: of the robots.
        """
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
        found.reset()
        return found

    def forget(self, birth: BirthId) -> None:
        """Drop all models of a robot that has died."""
        self._specs.pop(birth, None)
        for members in [key for key in self._clusters if birth in key]:
            del self._clusters[members]

    def _shared(self, births: tuple[BirthId, ...], bodies: Sequence[Body]) -> Cluster:
        specs, members = [], []
        for birth, body in zip(births, bodies, strict=True):
            prefix = f"{birth.island}.{birth.number}/"
            specs.append((prefix, self._spec(birth, body.robot)))
            members.append(Member(prefix, body.robot, body.solo.model))
        model = shared_model(
            specs, self._simulation, self.settings.environment, furnish=self._furnish
        )
        return Cluster(births, members, model, self.settings)

    def _spec(self, birth: BirthId, robot: Robot) -> mujoco.MjSpec:
        if birth not in self._specs:
            self._specs[birth] = robot_spec(robot, self._types, self._simulation).spec
        return self._specs[birth]
