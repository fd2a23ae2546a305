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
        radius: of a sphere about each one's core that holds all of it [m].
        radii: (B, 1) of the spheres that cover each [m].
    """

    def __init__(self, everybody: Sequence[Inhabitant]) -> None:
        """Number robots that are ordered by birth."""
        self.everybody = tuple(everybody)
        births = [one.birth for one in everybody]
        self.rows = {birth: row for row, birth in enumerate(births)}
        self.islands = np.array([birth.island for birth in births], dtype=np.int32)
        self.numbers = np.array([birth.number for birth in births], dtype=np.int64)
        reaches = [one.body.reach for one in everybody]
        self.radius = [reach.radius for reach in reaches]
        self.radii = [reach.radii[:, None] for reach in reaches]
        self.shifts = [reach.shifts for reach in reaches]
        self.weights = [reach.weights for reach in reaches]
        self.sizes = np.array([len(shifts) for shifts in self.shifts], dtype=np.intp)
        self.joint_counts = (self.sizes - _FREE).astype(np.int32)


class Layout:
    """Indices into the states of R robots in their clusters.

    The row has N numbers: of each cluster all positions, then all velocities.

    Attributes:
        roster: the robots; its ``islands``, ``numbers`` and ``joint_counts``.
        clusters: in the order of the row.
        positions, velocities: which of the numbers are what.
        homes: (R,) which of the clusters each one lives in.
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
        rows = [roster.rows[birth] for cluster in clusters for birth in cluster.members]
        own = [(s.joints, s.dofs) for cluster in clusters for s in cluster.seats]
        sizes = [size for c in clusters for size in (len(c.qpos), len(c.qvel))]
        ends = np.cumsum(sizes, dtype=np.intp)
        # Where each cluster's positions and velocities begin, for each of its seats.
        blocks = (ends - np.array(sizes, dtype=np.intp)).reshape(-1, 2)
        counts = [len(cluster.members) for cluster in clusters]
        begins = np.repeat(blocks, counts, axis=0) + np.array(own, np.intp).reshape(
            -1, 2
        )
        order = np.argsort(np.array(rows, dtype=np.intp))
        self.starts, self.dofs = begins[order].T
        self.homes: Indices = np.repeat(np.arange(len(counts)), counts)[order]
        self._set_sums(begins.T.reshape(-1), rows, order)
        are_positions = np.repeat(np.arange(len(sizes)) % 2 == 0, sizes)
        self.positions: Indices = are_positions.nonzero()[0]
        self.velocities: Indices = (~are_positions).nonzero()[0]
        self.roots = self.starts[:, None] + np.arange(_FREE)
        self.motions = self.dofs[:, None] + np.arange(_FREE_DOFS)
        angles = roster.sizes - _FREE
        first = np.repeat(self.starts + (_FREE - np.cumsum(angles) + angles), angles)
        self.joints = first + np.arange(len(first))

    def _set_sums(self, begins: Indices, rows: list[int], order: Indices) -> None:
        """Prepare the sums of ``bounds``.

        Args:
            begins: (2 R,) where positions and then velocities begin, seat by seat.
            rows: of the seats.
            order: of the seats by row.
        """
        sequence = np.argsort(begins)
        self._edges = begins[sequence]
        places = np.empty_like(sequence)
        places[sequence] = np.arange(len(sequence))
        self._order = np.concatenate([places[order], places[len(rows) + order]])
        shifts, weights = self.roster.shifts, self.roster.weights
        terms = [shifts[row] for row in rows] + [weights[row] for row in rows]
        self._weights = _joined([terms[number] for number in sequence.tolist()])

    def read(self) -> Floats:
        """Return all numbers in a row: a copy."""
        return _joined([part for c in self.clusters for part in (c.qpos, c.qvel)])

    def history(self, count: int) -> Floats:
        """Return the same at the moments of a stretch, (count, N)."""
        if not self.clusters:
            return np.zeros((count, 0))
        states = [cluster.track.state[:count] for cluster in self.clusters]
        return np.concatenate(states, axis=1)

    def bounds(self, differences: Floats) -> Floats:
        """Return how far robots moved and how fast they are at most, (..., 2, R).

        The first bounds how far any point of a robot is from where it was [m], the
        second the speed of its fastest point [m/s].

        Args:
            differences: (..., N) of positions from what they were, and velocities,
                all absolute.
        """
        shape = (*differences.shape[:-1], 2, len(self.starts))
        if not len(self._edges):
            return np.zeros(shape)
        sums = np.add.reduceat(differences * self._weights, self._edges, axis=-1)
        return np.asarray(sums[..., self._order].reshape(shape))

    def part(self, row: int) -> slice:
        """Return where a robot's configuration stands."""
        start = int(self.starts[row])
        return slice(start, start + int(self.roster.sizes[row]))


def _joined(parts: Sequence[Floats]) -> Floats:
    return np.concatenate(parts) if parts else np.zeros(0)
