"""Robots that share a model because they may touch: a cluster, of one or of many.

A robot alone has its own small model for life; those within each other's reach
share one that is made when they meet. Clusters know nothing of each other, so each
goes through a stretch of time at its own pace and keeps its state at the moments
at which somebody will want to know it.
"""

from collections.abc import Sequence

import mujoco
import numpy as np

from schema.errors import one_line
from schema.robot.ids import BirthId
from schema.robot.results import Floats
from schema.robot.robot import Robot
from worker.clusters.bounds import Indices
from worker.clusters.connected_components import Group, connected_components
from worker.clusters.engine_view import EngineView, Rules

NEVER = 1 << 62
"""A moment that does not come."""


class Track:
    """A cluster's states at K moments of a stretch of time, one row each.

    Attributes:
        state: (K, W) all of a moment as ``Cluster.live`` has it.
        qpos, qvel: positions and velocities of it, (K, Q) and (K, V).
        warnings: how often the engine had given each of its own.
        touching: the pairs of members in contact, if they are kept.
    """

    def __init__(self, cluster: "Cluster", count: int) -> None:
        """Make room for moments of a cluster."""
        self.state = np.zeros((count, sum(cluster.sizes)))
        ends = np.cumsum(cluster.sizes).tolist()
        parts = np.split(self.state, ends[:-1], axis=1)
        self.qpos, self.qvel = parts[:2]
        self._complaints: Indices = cluster.data.warning.number
        self.warnings = np.zeros((count, len(self._complaints)), dtype=np.intp)
        self.touching: list[list[tuple[int, int]]] = [[] for _ in range(count)]
        # Views of bytes: what is copied many times a second is copied by them.
        self._live = [_bytes(array) for array in cluster.live]
        self._rows = [[_bytes(array[k]) for array in parts] for k in range(count)]

    def __len__(self) -> int:
        return len(self._rows)

    def keep(self, moment: int) -> None:
        """Take the present state for that of a moment."""
        qpos, qvel, xpos, xmat = self._rows[moment]
        qpos[:], qvel[:], xpos[:], xmat[:] = self._live
        self.warnings[moment] = self._complaints


class Cluster:
    """A model, its state and who sits in it, by birth.

    Attributes:
        members: whose seats they are, ascending.
        views: in that order.
        live: its state just now, views: positions, velocities, places of all
            bodies and their rotations, as of the last step, each in one row.
        sizes: of these four.
        track: states at the moments of the last stretch of time.
        cost: of a step, in arbitrary units; decides who is dealt first.
        is_shared: by several robots.
        failure: why the engine gave up on it; empty if it did not.
        failed_at: moment of the stretch at which it did.
        touched: geoms in contact in the last step; kept only if a member has pads.
    """

    def __init__(
        self,
        members: tuple[BirthId, ...],
        prefixes: tuple[str, ...],
        model: mujoco.MjModel,
        *,
        tells_touches: bool = False,
    ) -> None:
        """Make the state of a model; seats come later.

        Args:
            members: by birth.
            prefixes: of their names in the model.
            model: that holds them.
            tells_touches: its track is to know who touched whom.
        """
        self.members, self.prefixes = members, prefixes
        self.model, self.data = model, mujoco.MjData(model)
        self.views: tuple[EngineView, ...] = ()
        self._owners = [-1] * model.ngeom
        self.qpos: Floats = self.data.qpos
        self.qvel: Floats = self.data.qvel
        frames = self.data.xpos.reshape(-1), self.data.xmat.reshape(-1)
        self.live: tuple[Floats, ...] = (self.qpos, self.qvel, *frames)
        self.sizes = tuple(len(array) for array in self.live)
        self.track = Track(self, 0)
        self.cost = int(model.nv + 4 * model.ngeom)
        self.failure, self.failed_at = "", NEVER
        self.touched: frozenset[int] = frozenset()
        self._has_pads = False
        self.is_shared = len(members) > 1
        self._tells_touches = tells_touches and self.is_shared

    def view(self, robot: Robot, solo: mujoco.MjModel, rules: Rules) -> None:
        """Find the next member's place."""
        prefix = self.prefixes[len(self.views)]
        view = EngineView(robot, solo, rules, (self.model, self.data, prefix))
        for geom in range(*view.geoms):
            self._owners[geom] = len(self.views)
        self.views = (*self.views, view)
        self._has_pads |= bool(view.senses.pads)

    def run(self, plan: Sequence[int], first: int = 0) -> None:
        """Let physics go on from moment to moment; the commands are held.

        Args:
            plan: steps to each moment from the one before.
            first: moment to begin with; those before are kept as they are.
        """
        if len(self.track) < len(plan):
            self.track = Track(self, len(plan))
        model, data, keep = self.model, self.data, self.track.keep
        for moment in range(first, len(plan)):
            try:
                mujoco.mj_step(model, data, nstep=plan[moment])
            except mujoco.FatalError as error:
                self.failure, self.failed_at = one_line(error), moment
                self.keep(range(moment, len(plan)))
                return
            keep(moment)
            if self._tells_touches:
                self.track.touching[moment] = self.touching()
        self._feel()

    def keep(self, moments: range) -> None:
        """Take the present state for that of some moments."""
        if len(self.track) < moments.stop:
            self.track = Track(self, moments.stop)
        for moment in moments:
            self.track.keep(moment)
            self.track.touching[moment] = self.touching()
        self._feel()

    def rewind(self, moment: int) -> None:
        """Go back to the state of a moment, from which its robots are to leave."""
        self.qpos[:], self.qvel[:] = self.track.qpos[moment], self.track.qvel[moment]

    def touching(self) -> list[tuple[int, int]]:
        """Return the pairs of members in contact in the last step, ascending."""
        if not self.is_shared or not self.data.ncon:
            return []
        owners = self._owners
        # Plain numbers: contacts are few, and most of them with the ground.
        geoms: list[list[int]] = self.data.contact.geom.tolist()
        pairs = {(owners[first], owners[second]) for first, second in geoms}
        return sorted({(min(p), max(p)) for p in pairs if p[0] != p[1] and min(p) >= 0})

    def parts(self) -> list[Group]:
        """Return the groups of members that hold together by contact."""
        if not self.is_shared:
            return [self.members]
        links = [(self.members[a], self.members[b]) for a, b in self.touching()]
        return connected_components([(birth,) for birth in self.members], links)

    def _feel(self) -> None:
        """Note what pads may feel while the engine's contacts are at hand."""
        if self._has_pads:
            geoms: list[int] = self.data.contact.geom.ravel().tolist()
            self.touched = frozenset(geoms)

    def reset(self) -> None:
        """Be as new, in an undefined place."""
        mujoco.mj_resetData(self.model, self.data)
        self.failure, self.failed_at = "", NEVER


def _bytes(array: Floats) -> memoryview:
    return array.data.cast("B")
