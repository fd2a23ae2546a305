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

_FREE = 7
"""Numbers of a free joint's position: place and quaternion."""


class Layout:
    """Indices into the states of R robots in their clusters.

    Attributes:
        islands, numbers: (R,) names of the robots, ascending.
        roots: (R, 7) where place and quaternion stand in all positions.
        joints: where the joint angles stand, robot by robot.
        joint_counts: (R,) how many each has.
    """

    def __init__(
        self, clusters: Sequence[Cluster], everybody: Sequence[Inhabitant]
    ) -> None:
        """Find everybody.

        Args:
            clusters: all of an arena, in any order that lasts.
            everybody: all robots, by birth.
        """
        self._qpos = [cluster.qpos for cluster in clusters]
        self._qvel = [cluster.qvel for cluster in clusters]
        row_of = {one.birth: row for row, one in enumerate(everybody)}
        starts = np.zeros(len(everybody), dtype=np.intp)
        seated: list[int] = []
        dofs: list[int] = []
        joint = dof = 0
        for cluster in clusters:
            for birth, seat in zip(cluster.members, cluster.seats, strict=True):
                row = row_of[birth]
                starts[row] = joint + seat.joints
                dofs.append(dof + seat.dofs)
                seated.append(row)
            joint += len(cluster.qpos)
            dof += len(cluster.qvel)
        births = [one.birth for one in everybody]
        self.islands = np.array([birth.island for birth in births], dtype=np.int32)
        self.numbers = np.array([birth.number for birth in births], dtype=np.int64)
        self.roots = starts[:, None] + np.arange(_FREE)
        sizes = [len(one.seat.qpos) - _FREE for one in everybody]
        self.joint_counts = np.array(sizes, dtype=np.int32)
        self.joints = np.concatenate(
            [
                np.arange(start + _FREE, start + _FREE + size)
                for start, size in zip(starts.tolist(), sizes, strict=True)
            ]
            or [np.zeros(0, dtype=np.intp)]
        )
        reaches = [everybody[row].body.reach for row in seated]
        none = [np.zeros(0)]
        self._weights = np.concatenate([r.weights for r in reaches] or none)
        self._shifts = np.concatenate([r.shifts for r in reaches] or none)
        self._dofs = np.array(dofs, dtype=np.intp)
        self._starts = starts[np.array(seated, dtype=np.intp)]
        # Rows by birth, of what comes in the order of the clusters.
        self._seated = np.argsort(np.array(seated, dtype=np.intp))

    def positions(self) -> Floats:
        """Return all clusters' positions in a row, a copy."""
        return np.concatenate(self._qpos) if self._qpos else np.zeros(0)

    def velocities(self) -> Floats:
        """Return all clusters' velocities in a row, a copy."""
        return np.concatenate(self._qvel) if self._qvel else np.zeros(0)

    def part(self, row: int) -> slice:
        """Return where a robot's configuration stands in all positions."""
        start = int(self.roots[row, 0])
        return slice(start, start + _FREE + int(self.joint_counts[row]))

    def speeds(self, velocities: Floats) -> Floats:
        """Return a bound on the speed of each robot's fastest point, (R,) [m/s].

        Args:
            velocities: of all clusters in a row, absolute.
        """
        return self._sums(velocities * self._weights, self._dofs)

    def moves(self, positions: Floats, others: Floats) -> Floats:
        """Return how far a point of each robot is at most from where it was, (R,).

        Args:
            positions: of all clusters in a row.
            others: the same at another time.
        """
        return self._sums(np.abs(positions - others) * self._shifts, self._starts)

    def _sums(self, terms: Floats, starts: Indices) -> Floats:
        """Return each robot's sum of terms, by birth."""
        if not len(starts):
            return np.zeros(0)
        return np.asarray(np.add.reduceat(terms, starts)[self._seated])
