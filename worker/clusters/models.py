"""Where robots become models: alone at birth, together when they meet."""

from collections import OrderedDict
from collections.abc import Sequence
from dataclasses import dataclass

import mujoco
from msgspec.structs import replace

from schema.experiment.document import body_space
from schema.experiment.settings import ArenaSettings
from schema.mjcf.footing import footprint, standing_height
from schema.mjcf.model import Furnish, robot_spec, shared_model, solo_model
from schema.mjcf.world import add_ring_wall
from schema.robot.ids import BirthId
from schema.robot.robot import Robot
from worker.clusters.bounds import BoundingSpheres, bounding_spheres
from worker.clusters.cluster import Cluster
from worker.clusters.engine_view import Rules
from worker.robot.controller import widths

CACHE_SIZE = 64
"""Models of clusters that are kept in case their members meet again."""


@dataclass(frozen=True, slots=True)
class Body:
    """A robot as the engine knows it, whoever it lives with.

    Attributes:
        robot: the robot; its brain is another's business.
        reach: what bounds it.
        home: the cluster in which it is alone.
    """

    robot: Robot
    reach: BoundingSpheres
    home: Cluster


class ModelCache:
    """Makes models of one arena, and keeps a few that may be wanted again."""

    def __init__(self, settings: ArenaSettings) -> None:
        """Start with an empty store.

        Args:
            settings: of the arena.
        """
        self.settings = settings
        self._simulation = replace(settings.simulation, drop_m=settings.arena.drop_m)
        self.width = widths(settings.space)
        self._rules = Rules(
            types=body_space(settings.space),
            width=self.width,
            has_light=settings.arena.light is not None,
        )
        self._store: OrderedDict[tuple[BirthId, ...], Cluster] = OrderedDict()
        self._specs: dict[BirthId, mujoco.MjSpec] = {}

    def body(self, birth: BirthId, robot: Robot) -> Body:
        """Return a robot at the origin, as high as the arena drops it there.

        Raises:
            ValueError: the engine cannot build it.
            ExperimentError: a sensor that the arena has nothing for.
        """
        types = self._rules.types
        model = solo_model(
            robot,
            types,
            self._simulation,
            self.settings.environment,
            furnish=self._furnish,
        )
        home = Cluster((birth,), ("",), model)
        home.view(robot, model, self._rules)
        return Body(robot, bounding_spheres(model), home)

    def height(self, body: Body, place: tuple[float, float], heading: float) -> float:
        """Return how high a robot's core is when the arena drops it [m].

        Args:
            body: the robot's.
            place: of the core's centre in the ground plane, world frame [m].
            heading: turn about z [rad].
        """
        environment, model = self.settings.environment, body.home.model
        if environment.is_even:
            return float(model.qpos0[2])
        boxes = footprint(model)
        return self._simulation.drop_m + standing_height(
            boxes, self._simulation, environment, place, heading
        )

    def cluster(self, births: Sequence[BirthId], bodies: Sequence[Body]) -> Cluster:
        """Return a cluster for robots, in an undefined state.

        Args:
            births: who, ascending.
            bodies: theirs.
        """
        members = tuple(births)
        if len(members) == 1:
            found = bodies[0].home
        elif members in self._store:
            self._store.move_to_end(members)
            found = self._store[members]
        else:
            found = self._shared(members, bodies)
            self._store[members] = found
            if len(self._store) > CACHE_SIZE:
                self._store.popitem(last=False)
        found.reset()
        return found

    def forget(self, birth: BirthId) -> None:
        """Drop all that was kept for a robot that is gone."""
        self._specs.pop(birth, None)
        for members in [key for key in self._store if birth in key]:
            del self._store[members]

    def _shared(self, members: tuple[BirthId, ...], bodies: Sequence[Body]) -> Cluster:
        prefixes = tuple(f"{birth.island}.{birth.number}/" for birth in members)
        specs = [
            self._spec(birth, body.robot)
            for birth, body in zip(members, bodies, strict=True)
        ]
        model = shared_model(
            list(zip(prefixes, specs, strict=True)),
            self._simulation,
            self.settings.environment,
            furnish=self._furnish,
        )
        tells = self.settings.arena.record_touches
        made = Cluster(members, prefixes, model, tells_touches=tells)
        for body in bodies:
            made.view(body.robot, body.home.model, self._rules)
        return made

    def _spec(self, birth: BirthId, robot: Robot) -> mujoco.MjSpec:
        if birth not in self._specs:
            types = self._rules.types
            self._specs[birth] = robot_spec(robot, types, self._simulation).spec
        return self._specs[birth]

    @property
    def _furnish(self) -> Furnish:
        arena, simulation = self.settings.arena, self._simulation
        return lambda spec: add_ring_wall(spec, arena, simulation)
