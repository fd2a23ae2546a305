"""Where each robot's numbers stand when the states of all clusters are put in a row.

Reading robot by robot costs more than the physics allows; so all clusters' states
are concatenated and robots are picked out of that by index, in birth order.
"""

from collections.abc import Sequence

import numpy as np

from schema.evaluation import Floats
from worker.cluster import Cluster
from worker.inhabitant import Inhabitant
from worker.reach import Indices

_FREE, _FREE_DOFS = 7, 6
"""Numbers of a free joint's position, place and quaternion; and of its velocity."""


class Roster:
    """What stays of R robots until somebody is born or dies, wherever they are.

    Attributes:
        everybody: by birth.
        rows: of each birth.
        islands, numbers: (R,) names.
        sizes: (R,) numbers of each one's position.
        joint_counts: (R,) how many joint angles each has.
    """

    def __init__(self, everybody: Sequence[Inhabitant]) -> None:
        """Number robots that are ordered by birth."""
        self.everybody = tuple(everybody)
        births = [one.birth for one in everybody]
        self.rows = {birth: row for row, birth in enumerate(births)}
        self.islands = np.array([birth.island for birth in births], dtype=np.int32)
        self.numbers = np.array([birth.number for birth in births], dtype=np.int64)
        reaches = [one.body.reach for one in everybody]
        self.shifts = [reach.shifts for reach in reaches]
        self.weights = [reach.weights for reach in reaches]
        self.sizes = np.array([len(shifts) for shifts in self.shifts], dtype=np.intp)
        self.joint_counts = (self.sizes - _FREE).astype(np.int32)


class Layout:
    """Indices into the states of R robots in their clusters.

    Attributes:
        roster: the robots; its ``islands``, ``numbers`` and ``joint_counts``.
        clusters: in the order of the row.
        size: number of all positions; velocities stand after them.
        starts, dofs: (R,) where each one's position and velocity begin.
        roots: (R, 7) where place and quaternion stand.
        motions: (R, 6) where velocity and turning of the core stand.
        joints: where the joint angles stand, robot by robot.
    """

    def __init__(self, clusters: Sequence[Cluster], roster: Roster) -> None:
        """Find everybody.

        Args:
            clusters: all of an arena, in any order that lasts.
            roster: all robots.
        """
        self.roster = roster
        self.islands, self.numbers = roster.islands, roster.numbers
        self.joint_counts = roster.joint_counts
        self.clusters = tuple(clusters)
        order, joints, dofs = [], [], []
        joint = dof = 0
        for cluster in clusters:
            for birth, seat in zip(cluster.members, cluster.seats, strict=True):
                order.append(roster.rows[birth])
                joints.append(joint + seat.joints)
                dofs.append(dof + seat.dofs)
            joint += len(cluster.qpos)
            dof += len(cluster.qvel)
        self.size = joint
        # Rows by birth, of what comes in the order of the clusters.
        self._seated = np.argsort(np.array(order, dtype=np.intp))
        self._first = np.array(joints, dtype=np.intp)
        self._first_dof = np.array(dofs, dtype=np.intp)
        self.starts: Indices = self._first[self._seated]
        self.dofs: Indices = self._first_dof[self._seated] + joint
        self.roots = self.starts[:, None] + np.arange(_FREE)
        self.motions = self.dofs[:, None] + np.arange(_FREE_DOFS)
        counts = roster.sizes - _FREE
        ends = np.cumsum(counts)
        own = np.repeat(self.starts + (_FREE - ends + counts), counts)
        self.joints = own + np.arange(len(own))
        self._shifts = _joined([roster.shifts[row] for row in order])
        self._weights = _joined([roster.weights[row] for row in order])

    def read(self) -> Floats:
        """Return all positions in a row, then all velocities: a copy."""
        parts = [cluster.qpos for cluster in self.clusters]
        return _joined(parts + [cluster.qvel for cluster in self.clusters])

    def history(self, count: int) -> Floats:
        """Return the same at the moments of a stretch, (count, N)."""
        if not self.clusters:
            return np.zeros((count, 0))
        tracks = [cluster.track for cluster in self.clusters]
        parts = [track.qpos[:count] for track in tracks]
        return np.concatenate([*parts, *(t.qvel[:count] for t in tracks)], axis=1)

    def moved(self, differences: Floats) -> Floats:
        """Return how far any point of each robot is at most from where it was [m].

        Args:
            differences: (..., N) of positions from what they were, absolute.
        """
        return self._summed(differences * self._shifts, self._first)

    def speeds(self, velocities: Floats) -> Floats:
        """Return a bound on the speed of each robot's fastest point [m/s].

        Args:
            velocities: (..., V) absolute.
        """
        return self._summed(velocities * self._weights, self._first_dof)

    def part(self, row: int) -> slice:
        """Return where a robot's configuration stands."""
        start = int(self.starts[row])
        return slice(start, start + int(self.roster.sizes[row]))

    def _summed(self, terms: Floats, starts: Indices) -> Floats:
        """Return the sums of each robot's terms, (..., R), by birth."""
        if not len(starts):
            return np.zeros((*terms.shape[:-1], 0))
        sums = np.add.reduceat(terms, starts, axis=-1)
        return np.asarray(sums[..., self._seated])


def _joined(parts: Sequence[Floats]) -> Floats:
    return np.concatenate(parts) if parts else np.zeros(0)
