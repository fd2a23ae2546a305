"""States of all clusters, and the intervals that they are stepped through.

Reading robot by robot would cost more than the physics. All clusters' states are
therefore concatenated, and robots are picked out of them by index, in birth order.
Clusters do not interact, so each is stepped to the end of an interval at once; then
the moments of the interval are handled one by one, for all clusters together.
"""

from collections.abc import Iterable, Sequence

import numpy as np

from schema.experiment.settings import ArenaSettings
from schema.robot.trace import Floats
from worker.clusters.cluster import Cluster
from worker.clusters.models import Indices
from worker.clusters.robot import ArenaRobot
from worker.robot.placed import FREE, FREE_DOFS

_PARTS = 4
"""Parts of a cluster's state that are read."""
_SPARE = 2
"""Columns for the states of clusters, for each that is needed."""
Pairs = list[tuple[int, int]]
"""Pairs of rows of robots, the lesser row first."""
MERGES_PER_SPLIT = 25
"""Clusters are checked for a split at every 25th check for merges."""
PLAUSIBLE = 1e6
"""Greatest plausible coordinate or velocity."""


class RobotRows:
    """Constants of R robots, by birth; valid until the next birth or death.

    Attributes:
        rows: row of each birth.
        islands, numbers: (R,) births.
        sizes: (R,) numbers of each one's position.
        joint_counts: (R,) joint angles of each.
        body_counts: (R,) bodies of each.
        first_bodies: (R,) the first of each among the N of all.
        hulls: (4, N) as ``BoundingSpheres.hulls``.
        sphere_bodies: body, of the N, that each sphere is fixed to.
        centres, radii: of all spheres, as in ``BoundingSpheres``.
        weights: of the absolute velocities of all, as ``BoundingSpheres.weights``.
    """

    def __init__(self, robots: Sequence[ArenaRobot]) -> None:
        self.robots = tuple(robots)
        births = [robot.birth for robot in robots]
        self.rows = {birth: row for row, birth in enumerate(births)}
        self.islands = np.array([birth.island for birth in births], dtype=np.int32)
        self.numbers = np.array([birth.number for birth in births], dtype=np.int64)
        bounds = [robot.body.bounds for robot in robots]
        self.weights = _joined([each.weights for each in bounds])
        hulls = np.concatenate([np.zeros((0, 4)), *(each.hulls for each in bounds)])
        self.hulls = np.ascontiguousarray(hulls.T)
        degrees = [len(each.weights) for each in bounds]
        self.sizes = np.array(degrees, dtype=np.intp) + (FREE - FREE_DOFS)
        self.joint_counts = (self.sizes - FREE).astype(np.int32)
        bodies = [len(each.hulls) for each in bounds]
        self.body_counts = np.array(bodies, dtype=np.intp)
        self.first_bodies = np.cumsum(self.body_counts) - self.body_counts
        self._body_pairs: dict[tuple[int, int], Indices] = {}
        fixed = [np.zeros(0, dtype=np.intp), *(each.bodies for each in bounds)]
        self.sphere_bodies: Indices = np.concatenate(fixed)
        counts = [len(each.radii) for each in bounds]
        self.sphere_bodies += np.repeat(self.first_bodies, counts)
        # Spheres are ordered by body.
        count = self.hulls.shape[1]
        self._sphere_counts = np.bincount(self.sphere_bodies, minlength=count)
        self._first_spheres = np.cumsum(self._sphere_counts) - self._sphere_counts
        centres = [np.zeros((0, 9)), *(each.centres for each in bounds)]
        self.centres: Floats = np.concatenate(centres)
        self.radii = _joined([each.radii for each in bounds])

    def body_pairs(self, here: int, there: int) -> Indices:
        """Return all pairs of a body, of the N, of each of two robots, (2, P)."""
        if (here, there) not in self._body_pairs:
            firsts, counts = self.first_bodies[[here, there]], self.body_counts
            both = np.indices((counts[here], counts[there])).reshape(2, -1)
            self._body_pairs[here, there] = both + firsts[:, None]
        return self._body_pairs[here, there]

    def sphere_pairs(
        self, first: Indices, second: Indices
    ) -> tuple[Indices, Indices, Indices]:
        """Return all pairs of a sphere of each of two bodies.

        Returns:
            (S,) first and second spheres, and (P,) numbers of pairs.
        """
        across = self._sphere_counts[second]
        counts = self._sphere_counts[first] * across
        place = np.arange(counts.sum()) - np.repeat(np.cumsum(counts) - counts, counts)
        rows, columns = np.divmod(place, np.repeat(across, counts))
        rows += np.repeat(self._first_spheres[first], counts)
        columns += np.repeat(self._first_spheres[second], counts)
        return rows, columns, counts


class StateColumns:
    """Array in which clusters keep their states at the moments of an interval, (K, W).

    Columns of clusters that are gone stay unused until the array is full.
    """

    def __init__(self, moments: int) -> None:
        self.states = np.zeros((moments, 0))
        self._starts: dict[Cluster, int] = {}
        self._end = 0

    def place(self, clusters: Sequence[Cluster]) -> list[int]:
        """Return the first column of each cluster; those of all others are free.

        The histories of new clusters move to their columns.
        """
        new = [cluster for cluster in clusters if cluster not in self._starts]
        if self._end + _size(new) > self.states.shape[1]:
            new, self._end = list(clusters), 0
            self.states = np.zeros((len(self.states), _SPARE * _size(new)))
        for cluster in new:
            cluster.history.move(self.states, self._end)
            self._starts[cluster] = self._end
            self._end += cluster.size
        self._starts = {cluster: self._starts[cluster] for cluster in clusters}
        return list(self._starts.values())


def _size(clusters: Iterable[Cluster]) -> int:
    return sum(cluster.size for cluster in clusters)


class Layout:
    """Indices into the states of R robots in their clusters.

    A state has W numbers, as ``StateColumns``.

    Attributes:
        clusters: in the order of the state.
        cluster_indices: (R,) index of each robot's cluster.
        starts: (R,) first index of each one's position.
        roots: (R, 7) of position and quaternion of the core.
        motions: (R, 6) of velocity and angular velocity of the core.
        joints: of the joint angles, robot by robot.
        states: (K, W) at the moments of an interval, in which the clusters keep them.
    """

    def __init__(
        self, clusters: Sequence[Cluster], robot_rows: RobotRows, columns: StateColumns
    ) -> None:
        self.robot_rows = robot_rows
        self.clusters = tuple(clusters)
        rows = [
            robot_rows.rows[birth] for cluster in clusters for birth in cluster.members
        ]
        own = [
            (view.joints.start, view.dofs.start, 3 * view.root, 9 * view.root)
            for cluster in clusters
            for view in cluster.views
        ]
        self._columns = columns.place(clusters)
        self.states = columns.states
        counts = [len(cluster.members) for cluster in clusters]
        parts = [cluster.parts for cluster in clusters]
        offsets = np.array(parts, dtype=np.intp).reshape(-1, _PARTS)
        offsets += np.array(self._columns, dtype=np.intp)[:, None]
        offsets = np.repeat(offsets, counts, axis=0)
        offsets += np.array(own, dtype=np.intp).reshape(-1, _PARTS)
        order = np.argsort(np.array(rows, dtype=np.intp))
        self.starts, dofs, first_places, first_rotations = offsets[order].T
        self.cluster_indices: Indices = np.repeat(np.arange(len(counts)), counts)[order]
        self.roots = self.starts[:, None] + np.arange(FREE)
        self.motions = dofs[:, None] + np.arange(FREE_DOFS)
        self.joints = runs(self.starts + FREE, robot_rows.sizes - FREE)
        degrees = robot_rows.sizes - (FREE - FREE_DOFS)
        self._velocities = runs(dofs, degrees)
        self._first_velocities = np.cumsum(degrees) - degrees
        self._places = runs(first_places, robot_rows.body_counts, 3)
        self._rotations = runs(first_rotations, robot_rows.body_counts, 9)
        # Of x and y: the origin, and the row of the rotation.
        self._origins = self._places + np.arange(2)[:, None]
        self._rows = self._rotations + np.arange(6).reshape(2, 3, 1)

    def read(self) -> Floats:
        """Return a copy of the present state, (W,)."""
        found = np.zeros(self.states.shape[1])
        for cluster, start in zip(self.clusters, self._columns, strict=True):
            found[start : start + cluster.size] = np.concatenate(cluster.live)
        return found

    def velocities(self, states: Floats) -> Floats:
        """Return all robots' absolute velocities in states (L, W), (L, V)."""
        found = states.take(self._velocities, axis=1)
        return np.asarray(np.abs(found, out=found))

    def speeds(self, velocities: Floats) -> Floats:
        """Return bounds on the speeds of robots' points, (L, R) [m/s], from (L, V)."""
        if not len(self._first_velocities):
            return np.zeros((len(velocities), 0))
        terms = velocities * self.robot_rows.weights
        return np.asarray(np.add.reduceat(terms, self._first_velocities, axis=1))

    def hulls(self, states: Floats) -> Floats:
        """Return x, y of all hulls' centres in states (L, W), (L, 2, N) [m]."""
        terms = states.take(self._rows, axis=1)
        terms *= self.robot_rows.hulls[:3]
        centres = terms[:, :, 0] + terms[:, :, 1]
        centres += terms[:, :, 2]
        centres += states.take(self._origins, axis=1)
        return centres

    def spheres(self, states: Floats, wanted: Indices) -> Floats:
        """Return the centres of B spheres of ``RobotRows``, (L, 3, B) [m]."""
        bodies = self.robot_rows.sphere_bodies[wanted]
        rotations = self._rotations[bodies][:, None] + np.arange(9)
        rotated = states.take(rotations, axis=1)
        rotated *= self.robot_rows.centres[wanted]
        centres: Floats = rotated[..., 0::3] + rotated[..., 1::3]
        centres += rotated[..., 2::3]
        centres += states.take(self._places[bodies][:, None] + np.arange(3), axis=1)
        return centres.transpose(0, 2, 1)


class Schedule:
    """Steps of ticks, samples, and checks for merges and splits, in an arena.

    Attributes:
        tick_steps: between two ticks of the controllers.
        most_moments: upper bound on the number of moments of an interval.
    """

    def __init__(self, settings: ArenaSettings) -> None:
        clock, merge_steps = settings.simulation, settings.arena.proximity_steps
        self.tick_steps = clock.brain_steps
        self._sample_steps, self._merge_steps = clock.pose_steps, merge_steps
        self._split_steps = MERGES_PER_SPLIT * merge_steps
        spacings = self._sample_steps, self._merge_steps
        between = sum(1 + self.tick_steps // each for each in spacings)
        self.most_moments = min(self.tick_steps, 1 + between)

    def is_tick(self, step: int) -> bool:
        """Whether controllers tick at a step."""
        return step % self.tick_steps == 0

    def is_sample(self, step: int) -> bool:
        """Whether positions are sampled at a step."""
        return step % self._sample_steps == 0

    def is_merge(self, step: int) -> bool:
        """Whether clusters are checked for merges at a step."""
        return step % self._merge_steps == 0

    def is_split(self, step: int) -> bool:
        """Whether clusters are checked for splits, and merges, at a step."""
        return step % self._split_steps == 0

    def next_tick(self, step: int) -> int:
        """Return the first tick after a step."""
        return _next(step, self.tick_steps)

    def moments(self, step: int, until: int) -> tuple[int, ...]:
        """Return the moments of the interval that starts at a step, ascending.

        The last moment is a tick, a check for splits or ``until``: clusters cannot be
        stepped independently beyond it.
        """
        end = min(until, self.next_tick(step), _next(step, self._split_steps))
        found = {end}
        for interval in (self._sample_steps, self._merge_steps):
            found.update(range(_next(step, interval), end, interval))
        return tuple(sorted(found))


class Rollout:
    """States of all clusters at the K moments of an interval.

    Attributes:
        plan: steps to each moment from the one before.
        after_merges: the moment after the last check for merges.
        moment: the one that is being handled.
        states: (K, W) in the order of the layout.
        velocities: (K, V) absolute, as ``Layout.velocities``.
        max_velocity: greatest of them; NaN if one is not a number.
        has_failures: whether the engine failed on a cluster.
        merge_pairs: pairs of rows to merge, by moment; computed on demand.
    """

    def __init__(self, plan: tuple[int, ...], is_merge: tuple[bool, ...]) -> None:
        self.plan = plan
        checks = [moment for moment, is_due in enumerate(is_merge) if is_due]
        self.after_merges = max(checks, default=-1) + 1
        self.moment = 0
        self.states = self.velocities = np.zeros((len(plan), 0))
        self.max_velocity = 0.0
        self.has_failures = False
        self.merge_pairs: dict[int, Pairs] = {}

    @property
    def state(self) -> Floats:
        """All clusters' state at the present moment, (W,)."""
        return np.asarray(self.states[self.moment])

    def read(self, layout: Layout) -> None:
        """Read all states; drops pairs that were computed from the old ones."""
        self.states = layout.states[: len(self.plan)]
        self.velocities = layout.velocities(self.states)
        self.max_velocity = float(self.velocities.max(initial=0.0))
        self.has_failures = any(cluster.failure for cluster in layout.clusters)
        self.merge_pairs = {}


def runs(starts: Indices, counts: Indices, spacing: int = 1) -> Indices:
    """Return the numbers of several arithmetic sequences, one after another.

    The first number and length of each are (R,); the spacing is that of its numbers.
    """
    first: Indices = np.repeat(starts - spacing * (np.cumsum(counts) - counts), counts)
    return first + spacing * np.arange(len(first))


def _joined(parts: Sequence[Floats]) -> Floats:
    return np.concatenate(parts) if parts else np.zeros(0)


def _next(step: int, interval: int) -> int:
    return step - step % interval + interval
