"""Records of an arena: samples for fitness windows, poses, contact durations."""

from collections import Counter
from collections.abc import Mapping, Sequence

import numpy as np

from schema.experiment.settings import ArenaSettings
from schema.robot.ids import BirthId
from schema.robot.trace import NEIGHBOUR_M, Floats
from schema.wire.arena import NO_POSES, Touch
from schema.wire.poses import PoseArrays
from worker.clusters.cluster import Cluster
from worker.clusters.population import ArenaPopulation
from worker.clusters.robot import ArenaRobot
from worker.clusters.states import Layout
from worker.measures import functions_of


class Samples:
    """Adds samples to the windows of an arena's robots."""

    def __init__(self, settings: ArenaSettings, population: ArenaPopulation) -> None:
        wanted = functions_of(settings).channels
        self._population = population
        self._is_recorded = bool(wanted)
        self._counts_neighbours = "neighbours" in wanted

    def first(self, step: int, robot: ArenaRobot) -> None:
        """Add the sample of a newborn at its place."""
        row: Floats | None = None
        if self._is_recorded:
            places = [one.place for one in self._population.robots]
            number = self._population.robot_rows.rows[robot.birth]
            neighbours = self._neighbours(places)[number]
            view, channels = robot.view, robot.body.channels
            readings = view.sensors.readings
            row = view.row(channels, neighbours, robot.outputs, readings)
        robot.window.add(step, robot.place, row)

    def add(self, step: int, state: Floats) -> None:
        """Add a sample of each robot, at the present moment of an interval."""
        layout, robots = self._population.layout, self._population.robots
        places = state[layout.roots[:, :3]].tolist()
        for robot, (x, y, z) in zip(robots, places, strict=True):
            robot.place = (x, y, z)
            if not self._is_recorded:
                robot.window.add(step, robot.place)
        if self._is_recorded:
            self._record(step, state)

    def _record(self, step: int, state: Floats) -> None:
        population, layout = self._population, self._population.layout
        rollout = population.rollout
        assert rollout is not None
        neighbours = self._neighbours([robot.place for robot in population.robots])
        sizes = layout.robot_rows.sizes.tolist()
        dofs = layout.motions[:, 0].tolist()
        for number, robot in enumerate(population.robots):
            start, dof = int(layout.starts[number]), dofs[number]
            cluster = population.cluster_of[robot.birth]
            probed = cluster.history.probed[rollout.moment]
            row = robot.body.channels.row(
                state[start : start + sizes[number]],
                state[dof : dof + sizes[number] - 1],
                probe=probed[cluster.members.index(robot.birth)] if probed else None,
                readings=robot.view.sensors.readings,
                neighbours=neighbours[number],
                outputs=robot.outputs,
                commands=robot.view.ctrl,
            )
            robot.window.add(step, robot.place, row)

    def _neighbours(self, places: Sequence[Sequence[float]]) -> list[int]:
        """Return how many robots are near each one; 0 if nothing needs it."""
        if not self._counts_neighbours:
            return [0] * len(places)
        at = np.array(places)
        apart = at[:, np.newaxis] - at
        is_near = (apart * apart).sum(axis=2) <= NEIGHBOUR_M**2
        counts: list[int] = (is_near.sum(axis=1) - 1).tolist()
        return counts


class MotorWork:
    """Work of the motors during an advance, added to ``ArenaRobot.work_j``.

    The power of a motor is the absolute value of torque times velocity, read at the
    checks for merges, which do not depend on where advances end: 25 a second by
    default. Over 20 s the work of eight robots differed from the exact one, the measure
    ``energy``, by up to a third.
    """

    def __init__(self, settings: ArenaSettings) -> None:
        steps = settings.arena.proximity_steps
        self._interval_s = steps * settings.simulation.timestep_s
        self._layout: Layout | None = None

    def begin(
        self, robots: Sequence[ArenaRobot], work_j: Mapping[BirthId, float]
    ) -> None:
        """Begin an advance of robots; some have worked before [J]."""
        self.read_motors(robots)
        for robot in robots:
            robot.work_j = work_j.get(robot.birth, 0.0)

    def read_motors(self, robots: Sequence[ArenaRobot]) -> None:
        """Take the motors as they are now: their torques may change."""
        self._layout = None
        self._motors = {robot.birth: robot.view.servos.torques() for robot in robots}

    def add(self, layout: Layout, state: Floats) -> None:
        """Add the work since the last check; ``state`` is the present one."""
        robots = layout.robot_rows.robots
        if layout is not self._layout:
            self._layout = layout
            motors = [self._motors[robot.birth] for robot in robots]
            counts = [len(each[0]) for each in motors]
            self._rows = np.repeat(np.arange(len(robots)), counts)
            self._columns = layout.motions[self._rows, 0]
            self._columns += np.concatenate([each[0] for each in motors])
            self._stiffness = np.concatenate([each[1] for each in motors])
            self._limits = np.concatenate([each[2] for each in motors])
        velocity = state[self._columns]
        wanted = np.concatenate([robot.view.ctrl for robot in robots])
        torque = self._stiffness * (wanted - velocity)
        power = np.abs(np.clip(torque, -self._limits, self._limits) * velocity)
        sums = np.bincount(self._rows, power, minlength=len(robots))
        for robot, work_j in zip(
            robots, (sums * self._interval_s).tolist(), strict=True
        ):
            robot.work_j += work_j


class PoseLog:
    """Samples of all robots' poses."""

    def __init__(self, timestep_s: float) -> None:
        self._timestep_s = timestep_s
        self._samples: list[tuple[int, Layout, Floats, Floats]] = []

    def add(self, step: int, layout: Layout, state: Floats) -> None:
        """Add a sample."""
        if layout.robot_rows.robots:
            roots, angles = state[layout.roots], state[layout.joints]
            self._samples.append((step, layout, roots, angles))

    def take(self) -> PoseArrays:
        """Return all samples and forget them."""
        if not self._samples:
            return PoseArrays.received(NO_POSES)
        steps, layouts, roots, angles = zip(*self._samples, strict=True)
        self._samples = []
        rows = [layout.robot_rows for layout in layouts]
        return PoseArrays(
            islands=np.concatenate([row.islands for row in rows]),
            births=np.concatenate([row.numbers for row in rows]),
            times_s=np.repeat(
                [step * self._timestep_s for step in steps],
                [len(row.robots) for row in rows],
            ),
            cores=np.concatenate(roots).astype(np.float32),
            joints=np.concatenate([row.joint_counts for row in rows]),
            angles=np.concatenate(angles).astype(np.float32),
        )


class Contacts:
    """Contact durations of an advance; each check counts one whole interval."""

    def __init__(self, settings: ArenaSettings) -> None:
        steps = settings.arena.proximity_steps
        self._interval_s = steps * settings.simulation.timestep_s
        self._counts: Counter[tuple[BirthId, BirthId]] = Counter()

    def count(self, clusters: Sequence[Cluster], moment: int) -> None:
        """Count the pairs in contact at a moment of the clusters' histories."""
        for cluster in clusters:
            for first, second in cluster.history.touching[moment]:
                self._counts[cluster.members[first], cluster.members[second]] += 1

    def take(self) -> tuple[Touch, ...]:
        """Return the durations by pair and reset them."""
        counts = sorted(self._counts.items())
        self._counts.clear()
        return tuple(Touch(*pair, count * self._interval_s) for pair, count in counts)
