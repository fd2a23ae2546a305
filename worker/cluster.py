"""Robots that share a model because they may touch: a cluster, of one or of many.

A robot alone has its own small model for life; those within each other's reach
share one that is made when they meet. A robot sits in a cluster with views of its
part of the state, and takes its whole state along when it moves to another.
"""

from collections import OrderedDict
from collections.abc import Sequence
from dataclasses import dataclass

import mujoco
import numpy as np
from msgspec.structs import replace

from schema.birth import BirthId
from schema.evaluation import Floats
from schema.experiment import body_space
from schema.mjcf import Scenery, add_ring_wall, robot_spec, shared_model, solo_model
from schema.robot import Robot
from schema.settings import ArenaSettings
from worker.controller import widths
from worker.reach import Indices, Reach, reach_of
from worker.sensors import Senses, Servos, find, free_joint

CACHE_SIZE = 64
"""Models of clusters that are kept in case their members meet again."""


class Seat:
    """One robot's place in a cluster: live views, its senses and its motors.

    Attributes:
        model, data: of the cluster.
        qpos, qvel, ctrl: its part of the state.
        xpos, xmat: frames of its bodies as of the last step, (N, 3) and (N, 9).
        joints: where its part of qpos starts in the cluster's.
        geoms: first and last + 1 of its geoms.
    """

    def __init__(
        self, robot: Robot, solo: mujoco.MjModel, shop: "Shop", cluster: "Cluster"
    ) -> None:
        """Find a robot in a cluster by the prefix of its names.

        Args:
            robot: the robot.
            solo: the model in which it is alone: tells its sizes.
            shop: the arena's settings.
            cluster: whose model and data have just been made.
        """
        self.model, self.data = cluster.model, cluster.data
        model, data = self.model, self.data
        prefix = cluster.prefixes[len(cluster.seats)]
        free = free_joint(model, prefix)
        first = find(model, mujoco.mjtObj.mjOBJ_BODY, f"{prefix}root")
        root = int(solo.jnt_bodyid[0])
        bodies = slice(first, first + solo.nbody - root)
        self.joints = int(model.jnt_qposadr[free])
        self.dofs = int(model.jnt_dofadr[free])
        geom = int(model.body_geomadr[first])
        self.geoms = (geom, geom + solo.ngeom - int(solo.body_geomadr[root]))
        types = body_space(shop.settings.space)
        self.senses = Senses(
            robot,
            types,
            model,
            width=shop.width.inputs,
            prefix=prefix,
            has_light=shop.settings.arena.light is not None,
        )
        self.servos = Servos(robot, types, model, prefix=prefix)
        self.qpos: Floats = data.qpos[self.joints : self.joints + solo.nq]
        self.qvel: Floats = data.qvel[self.dofs : self.dofs + solo.nv]
        self.ctrl: Floats = data.ctrl[self.servos.slots]
        self.xpos: Floats = data.xpos[bodies]
        self.xmat: Floats = data.xmat[bodies]

    def start(self) -> None:
        """Feel for the first time."""
        self.senses.start(self.model, self.data)

    def feel(self, interval_s: float) -> None:
        """Read all sensors; ``interval_s`` has passed since the last reading."""
        self.senses.read(self.model, self.data, interval_s)

    def drive(self, outputs: Floats) -> None:
        """Command the motors; (O,) outputs of the network."""
        self.servos.drive(self.data, outputs)

    def take(self, other: "Seat") -> None:
        """Take over a robot's whole state from the seat that it leaves."""
        self.qpos[:], self.qvel[:] = other.qpos, other.qvel
        self.ctrl[:] = other.ctrl
        self.senses.readings[:] = other.senses.readings
        self.senses.velocities = list(other.senses.velocities)


class Cluster:
    """A model, its state and who sits in it, by birth.

    Attributes:
        members: whose seats they are, ascending.
        seats: in that order.
        warnings: how often the engine gave each of its warnings, a live view.
        cost: of a step, in arbitrary units; decides who is dealt first.
        is_shared: by several robots.
        failure: why the engine gave up on it; empty if it did not.
    """

    def __init__(
        self,
        members: tuple[BirthId, ...],
        prefixes: tuple[str, ...],
        model: mujoco.MjModel,
    ) -> None:
        """Make the state of a model; seats come later."""
        self.members, self.prefixes = members, prefixes
        self.model, self.data = model, mujoco.MjData(model)
        self.seats: tuple[Seat, ...] = ()
        self._owners = np.full(model.ngeom, -1, dtype=np.intp)
        self.qpos: Floats = self.data.qpos
        self.qvel: Floats = self.data.qvel
        self.warnings: Indices = self.data.warning.number
        self.cost = int(model.nv + 4 * model.ngeom)
        self.failure = ""
        self.is_shared = len(members) > 1

    def seat(self, robot: Robot, solo: mujoco.MjModel, shop: "Shop") -> None:
        """Find the next member's place."""
        seat = Seat(robot, solo, shop, self)
        self._owners[slice(*seat.geoms)] = len(self.seats)
        self.seats = (*self.seats, seat)

    def step(self, count: int) -> None:
        """Let physics go on for some steps; the commands are held."""
        try:
            mujoco.mj_step(self.model, self.data, nstep=count)
        except mujoco.FatalError as error:
            self.failure = str(error)

    def touching(self) -> list[tuple[int, int]]:
        """Return the pairs of members in contact in the last step, ascending."""
        if not self.is_shared or not self.data.ncon:
            return []
        owners = self._owners[self.data.contact.geom]
        owners = np.sort(owners[(owners >= 0).all(axis=1)], axis=1)
        pairs = {(a, b) for a, b in owners.tolist() if a != b}
        return sorted(pairs)


@dataclass(frozen=True, slots=True)
class Body:
    """A robot as the engine knows it, whoever it lives with.

    Attributes:
        robot: the robot; its brain is another's business.
        reach: what bounds it.
        home: the cluster in which it is alone.
    """

    robot: Robot
    reach: Reach
    home: Cluster


class Shop:
    """Makes models of one arena, and keeps a few that may be wanted again."""

    def __init__(self, settings: ArenaSettings) -> None:
        """Start with an empty store.

        Args:
            settings: of the arena.
        """
        self.settings = settings
        self._simulation = replace(settings.simulation, drop_m=settings.arena.drop_m)
        self.width = widths(settings.space)
        self._store: OrderedDict[tuple[BirthId, ...], Cluster] = OrderedDict()
        self._specs: dict[BirthId, mujoco.MjSpec] = {}

    def body(self, birth: BirthId, robot: Robot) -> Body:
        """Return a robot at the origin, as high as the arena drops it.

        Raises:
            ValueError: the engine cannot build it.
            ExperimentError: a sensor that the arena has nothing for.
        """
        types = body_space(self.settings.space)
        model = solo_model(robot, types, self._simulation, scenery=self._scenery)
        home = Cluster((birth,), ("",), model)
        home.seat(robot, model, self)
        return Body(robot, reach_of(model), home)

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
        mujoco.mj_resetData(found.model, found.data)
        found.failure = ""
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
            scenery=self._scenery,
        )
        made = Cluster(members, prefixes, model)
        for body in bodies:
            made.seat(body.robot, body.home.model, self)
        return made

    def _spec(self, birth: BirthId, robot: Robot) -> mujoco.MjSpec:
        if birth not in self._specs:
            types = body_space(self.settings.space)
            self._specs[birth] = robot_spec(robot, types, self._simulation).spec
        return self._specs[birth]

    @property
    def _scenery(self) -> Scenery:
        arena, simulation = self.settings.arena, self._simulation
        return lambda spec: add_ring_wall(spec, arena, simulation)
