"""Where each robot's numbers stand when the states of all clusters are put in a row.

Reading robot by robot costs more than the physics allows; so all clusters' states
are concatenated and robots are picked out of that by index, in birth order.
"""

from collections.abc import Sequence

import numpy as np

from schema.evaluation import Floats
from worker.cluster import Cluster
from worker.inhabitant import Inhabitant

_FREE = 7
"""Numbers of a free joint's position: place and quaternion."""


class Layout:
    """Indices into the states of R robots in their clusters.

    Attributes:
        islands, numbers: (R,) names of the robots, ascending.
        roots: (R, 7) where place and quaternion stand in all positions.
        joints: where the joint angles stand, robot by robot.
        joint_counts: (R,) how many each has.
        size: number of all positions.
    """

    def __init__(
        self, clusters: Sequence[Cluster], everybody: Sequence[Inhabitant]
    ) -> None:
        """Find everybody.

        Args:
            clusters: all of an arena, in any order that lasts.
            everybody: all robots, by birth.
        """
        self._views = [cluster.qpos for cluster in clusters]
        self._views += [cluster.qvel for cluster in clusters]
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
        self.size = joint
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
        self._weights = np.concatenate(
            [r.shifts for r in reaches] + [r.weights for r in reaches] or [np.zeros(0)]
        )
        own = starts[np.array(seated, dtype=np.intp)]
        self._starts = np.concatenate([own, np.array(dofs, dtype=np.intp) + joint])
        # Rows by birth, of what comes in the order of the clusters.
        rows = np.argsort(np.array(seated, dtype=np.intp))
        self._seated = np.concatenate([rows, rows + len(rows)])

    def read(self) -> Floats:
        """Return all clusters' positions in a row, then their velocities: a copy."""
        return np.concatenate(self._views) if self._views else np.zeros(0)

    def bounds(self, differences: Floats) -> Floats:
        """Return how far robots moved and how fast they are at most, (2, R).

        The first row bounds how far any point of a robot is from where it was [m],
        the second the speed of its fastest point [m/s].

        Args:
            differences: of positions from what they were, then velocities, all
                absolute, in the order of ``read``.
        """
        if not len(self._starts):
            return np.zeros((2, 0))
        sums = np.add.reduceat(differences * self._weights, self._starts)
        return np.asarray(sums[self._seated].reshape(2, -1))

    def part(self, row: int) -> slice:
        """Return where a robot's configuration stands in all positions."""
        start = int(self.roots[row, 0])
        return slice(start, start + _FREE + int(self.joint_counts[row]))
