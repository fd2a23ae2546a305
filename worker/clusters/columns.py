"""Where each robot's numbers stand when the states of all clusters are put in a row.

Reading robot by robot costs more than the physics allows; so all clusters' states
are concatenated and robots are picked out of that by index, in birth order.
"""

from collections.abc import Sequence

import numpy as np

from schema.robot.results import Floats
from worker.clusters.bounds import Indices
from worker.clusters.cluster import Cluster
from worker.clusters.robot import ArenaRobot

_FREE, _FREE_DOFS = 7, 6
"""Numbers of a free joint's position, place and quaternion; and of its velocity."""
_PARTS = 4
"""Parts of a cluster's state."""


class RobotRows:
    """What stays of R robots until somebody is born or dies, wherever they are.

    Attributes:
        everybody: by birth.
        rows: of each birth.
        islands, numbers: (R,) names.
        sizes: (R,) numbers of each one's position.
        joint_counts: (R,) how many joint angles each has.
        body_counts: (R,) how many bodies each has.
        first_bodies: (R,) the first of each among the N of all.
        spans: of each robot, which of the N are its own.
        hulls: (4, N) as ``BoundingSpheres.hulls``.
        ball_counts: (R,) how many spheres cover each.
        first_balls: (R,) the first of each among all spheres.
        balls: which of the N each sphere is fixed to.
        centres, radii: of all spheres, as in ``BoundingSpheres``.
        weights: of the absolute velocities of all, as ``BoundingSpheres.weights``.
    """

    def __init__(self, everybody: Sequence[ArenaRobot]) -> None:
        """Number robots that are ordered by birth."""
        self.everybody = tuple(everybody)
        births = [one.birth for one in everybody]
        self.rows = {birth: row for row, birth in enumerate(births)}
        self.islands = np.array([birth.island for birth in births], dtype=np.int32)
        self.numbers = np.array([birth.number for birth in births], dtype=np.int64)
        reaches = [one.body.reach for one in everybody]
        self.weights = _joined([reach.weights for reach in reaches])
        hulls = np.concatenate([np.zeros((0, 4)), *(reach.hulls for reach in reaches)])
        self.hulls = np.ascontiguousarray(hulls.T)
        degrees = [len(reach.weights) for reach in reaches]
        self.sizes = np.array(degrees, dtype=np.intp) + (_FREE - _FREE_DOFS)
        self.joint_counts = (self.sizes - _FREE).astype(np.int32)
        bodies = [len(reach.hulls) for reach in reaches]
        self.body_counts = np.array(bodies, dtype=np.intp)
        self.first_bodies = np.cumsum(self.body_counts) - self.body_counts
        firsts = zip(self.first_bodies.tolist(), bodies, strict=True)
        self.spans = [slice(first, first + count) for first, count in firsts]
        self.ball_counts = np.array([len(r.radii) for r in reaches], dtype=np.intp)
        self.first_balls = np.cumsum(self.ball_counts) - self.ball_counts
        fixed = [np.zeros(0, dtype=np.intp), *(reach.bodies for reach in reaches)]
        self.balls: Indices = np.concatenate(fixed)
        self.balls += np.repeat(self.first_bodies, self.ball_counts)
        centres = [np.zeros((0, 9)), *(reach.centres for reach in reaches)]
        self.centres: Floats = np.concatenate(centres)
        self.radii = _joined([reach.radii for reach in reaches])


class Layout:
    """Indices into the states of R robots in their clusters.

    The row has W numbers: of each cluster all of ``Cluster.live``.

    Attributes:
        robot_rows: the robots; its ``islands``, ``numbers`` and ``joint_counts``.
        clusters: in the order of the row.
        homes: (R,) which of the clusters each one lives in.
        starts, dofs: (R,) where each one's position and velocity begin.
        roots: (R, 7) where place and quaternion stand.
        motions: (R, 6) where velocity and turning of the core stand.
        joints: where the joint angles stand, robot by robot.
        velocities: where the velocities stand, robot by robot.
    """

    def __init__(self, clusters: Sequence[Cluster], robot_rows: RobotRows) -> None:
        """Find everybody.

        Args:
            clusters: all of an arena, in any order that lasts.
            robot_rows: all robots.
        """
        self.robot_rows = robot_rows
        self.islands, self.numbers = robot_rows.islands, robot_rows.numbers
        self.joint_counts = robot_rows.joint_counts
        self.clusters = tuple(clusters)
        rows = [
            robot_rows.rows[birth] for cluster in clusters for birth in cluster.members
        ]
        own = [view.offsets for cluster in clusters for view in cluster.views]
        sizes = np.array([c.sizes for c in clusters], dtype=np.intp).reshape(-1)
        # Where each cluster's four parts begin, for each of its seats.
        blocks = (np.cumsum(sizes) - sizes).reshape(-1, _PARTS)
        counts = [len(cluster.members) for cluster in clusters]
        begins = np.repeat(blocks, counts, axis=0)
        begins += np.array(own, dtype=np.intp).reshape(-1, _PARTS)
        order = np.argsort(np.array(rows, dtype=np.intp))
        self.starts, self.dofs, first_places, first_turns = begins[order].T
        self.homes: Indices = np.repeat(np.arange(len(counts)), counts)[order]
        self.roots = self.starts[:, None] + np.arange(_FREE)
        self.motions = self.dofs[:, None] + np.arange(_FREE_DOFS)
        self.joints = runs(self.starts + _FREE, robot_rows.sizes - _FREE)
        degrees = robot_rows.sizes - (_FREE - _FREE_DOFS)
        self.velocities = runs(self.dofs, degrees)
        self._first_velocities = np.cumsum(degrees) - degrees
        self._places = runs(first_places, robot_rows.body_counts, 3)
        self._turns = runs(first_turns, robot_rows.body_counts, 9)
        # Of x and y: the origin, and the row of the rotation.
        self._origins = self._places + np.arange(2)[:, None]
        self._rows = self._turns + np.arange(6).reshape(2, 3, 1)

    def read(self) -> Floats:
        """Return all numbers in a row: a copy."""
        return _joined([part for cluster in self.clusters for part in cluster.live])

    def history(self, count: int) -> Floats:
        """Return the same at the moments of a stretch, (count, W)."""
        if not self.clusters:
            return np.zeros((count, 0))
        states = [cluster.track.state[:count] for cluster in self.clusters]
        return np.concatenate(states, axis=1)

    def speeds(self, states: Floats) -> Floats:
        """Return how fast each robot's fastest point is at most, (L, R) [m/s].

        Args:
            states: (L, W).
        """
        if not len(self._first_velocities):
            return np.zeros((len(states), 0))
        terms = np.abs(states.take(self.velocities, axis=1))
        terms *= self.robot_rows.weights
        return np.asarray(np.add.reduceat(terms, self._first_velocities, axis=1))

    def hulls(self, states: Floats) -> Floats:
        """Return x and y of the centres of all bodies' hulls, (L, 2, N) [m].

        Args:
            states: (L, W).
        """
        terms = states.take(self._rows, axis=1)
        terms *= self.robot_rows.hulls[:3]
        centres = terms[:, :, 0] + terms[:, :, 1]
        centres += terms[:, :, 2]
        centres += states.take(self._origins, axis=1)
        return centres

    def balls(self, states: Floats, wanted: Indices) -> Floats:
        """Return the centres of spheres that cover robots, (L, 3, B) [m].

        Args:
            states: (L, W).
            wanted: (B,) which of all spheres, as ``RobotRows`` numbers them.
        """
        bodies = self.robot_rows.balls[wanted]
        turns = self._turns[bodies][:, None] + np.arange(9)
        turned = states.take(turns, axis=1)
        turned *= self.robot_rows.centres[wanted]
        moved: Floats = turned[..., 0::3] + turned[..., 1::3]
        moved += turned[..., 2::3]
        moved += states.take(self._places[bodies][:, None] + np.arange(3), axis=1)
        return moved.transpose(0, 2, 1)

    def part(self, row: int) -> slice:
        """Return where a robot's configuration stands."""
        start = int(self.starts[row])
        return slice(start, start + int(self.robot_rows.sizes[row]))


def runs(starts: Indices, counts: Indices, rollout: int = 1) -> Indices:
    """Return the numbers of some runs, each from its start on, one after another.

    Args:
        starts: (R,) of the runs.
        counts: (R,) how many numbers each has.
        rollout: from one number of a run to the next.
    """
    first: Indices = np.repeat(starts - rollout * (np.cumsum(counts) - counts), counts)
    return first + rollout * np.arange(len(first))


def _joined(parts: Sequence[Floats]) -> Floats:
    return np.concatenate(parts) if parts else np.zeros(0)
