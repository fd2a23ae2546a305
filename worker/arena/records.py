"""Records of an arena: samples for fitness windows, poses, contact durations."""

from collections import Counter
from collections.abc import Sequence

import numpy as np
import numpy.typing as npt
import pyarrow as pa

from schema.experiment.settings import ArenaSettings
from schema.robot.ids import BirthId
from schema.robot.trace import NEIGHBOUR_M, Floats
from schema.tables.columns import ROWS
from schema.wire.arena import Touch
from worker.clusters.cluster import Cluster
from worker.clusters.population import ArenaPopulation
from worker.clusters.robot import ArenaRobot
from worker.clusters.states import Layout
from worker.measures.functions import functions_of

_SCHEMA = ROWS["poses"]


class Samples:
    """Adds samples to the windows of an arena's robots."""

    def __init__(self, settings: ArenaSettings, population: ArenaPopulation) -> None:
        """Find out which channels are recorded.

        Args:
            settings: of the arena.
            population: its living robots.
        """
        wanted = functions_of(settings).channels
        self._population = population
        self._is_recorded = bool(wanted)
        self._counts_neighbours = "neighbours" in wanted

    def first(self, step: int, robot: ArenaRobot) -> None:
        """Add the sample of a newborn at its place.

        Args:
            step: of the arena.
            robot: not moved since its first readings, and part of the population.
        """
        row: Floats | None = None
        if self._is_recorded:
            places = [one.place for one in self._population.robots]
            number = self._population.robot_rows.rows[robot.birth]
            neighbours = self._neighbours(places)[number]
            row = robot.view.row(robot.body.channels, neighbours)
        robot.window.add(step, robot.place, row)

    def add(self, step: int, state: Floats) -> None:
        """Add a sample of each robot, at the present moment of an interval.

        Args:
            step: of the arena.
            state: of all clusters, (W,) in the order of the layout.
        """
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
            )
            robot.window.add(step, robot.place, row)

    def _neighbours(self, places: Sequence[Sequence[float]]) -> list[int]:
        """Return how many robots are near each one; 0 if nothing needs it.

        Args:
            places: of the cores, by birth [m].
        """
        if not self._counts_neighbours:
            return [0] * len(places)
        at = np.array(places)
        apart = at[:, np.newaxis] - at
        is_near = (apart * apart).sum(axis=2) <= NEIGHBOUR_M**2
        counts: list[int] = (is_near.sum(axis=1) - 1).tolist()
        return counts


class Poses:
    """Samples of all robots' poses."""

    def __init__(self, timestep_s: float) -> None:
        """Initialise without samples; ``timestep_s`` is the length of a step."""
        self._timestep_s = timestep_s
        self._samples: list[tuple[int, Layout, Floats, Floats]] = []

    def add(self, step: int, layout: Layout, state: Floats) -> None:
        """Add a sample.

        Args:
            step: of the arena.
            layout: of the state.
            state: of all clusters.
        """
        if layout.robot_rows.robots:
            roots, angles = state[layout.roots], state[layout.joints]
            self._samples.append((step, layout, roots, angles))

    def take(self) -> bytes:
        """Return all samples as an Arrow IPC stream and forget them.

        Without samples there are no bytes.

        The columns name robots by birth only. The requester of the advance adds the
        arena.
        """
        if not self._samples:
            return b""
        steps, layouts, roots, angles = zip(*self._samples, strict=True)
        self._samples = []
        rows = [layout.robot_rows for layout in layouts]
        batch = pose_batch(
            islands=np.concatenate([each.islands for each in rows]),
            numbers=np.concatenate([each.numbers for each in rows]),
            times_s=np.repeat(
                [step * self._timestep_s for step in steps],
                [len(each.robots) for each in rows],
            ),
            roots=np.concatenate(roots),
            joint_counts=np.concatenate([each.joint_counts for each in rows]),
            angles=np.concatenate(angles),
        )
        sink = pa.BufferOutputStream()
        with pa.ipc.new_stream(sink, _SCHEMA) as writer:
            writer.write_batch(batch)
        return bytes(sink.getvalue().to_pybytes())


class Contacts:
    """Contact durations of an advance; each check counts one whole interval."""

    def __init__(self, settings: ArenaSettings) -> None:
        """Initialise without contacts."""
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


def pose_batch(
    *,
    islands: npt.NDArray[np.int32],
    numbers: npt.NDArray[np.int64],
    times_s: Floats,
    roots: Floats,
    joint_counts: npt.NDArray[np.int32],
    angles: Floats,
) -> pa.RecordBatch:
    """Return N rows of the poses table, with the columns in ``ROWS``.

    Args:
        islands: (N,) of the robots' births.
        numbers: (N,) of the robots' births.
        times_s: (N,) simulated time [s].
        roots: (N, 7) position [m] and quaternion of the core.
        joint_counts: (N,) joint angles of each row.
        angles: of all joints, row by row [rad].
    """
    ends = np.concatenate([[0], np.cumsum(joint_counts)]).astype(np.int32)
    columns = [
        islands,
        pa.nulls(len(times_s), pa.int32()),
        numbers,
        times_s,
        *roots.astype(np.float32).T,
        pa.ListArray.from_arrays(
            pa.array(ends),
            pa.array(angles.astype(np.float32)),
            type=_SCHEMA.field("angles").type,
        ),
    ]
    return pa.record_batch(columns, schema=_SCHEMA)
