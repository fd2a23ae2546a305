"""Clusters of robots that share one engine model because they may touch.

A robot alone has its own small model for life. Robots that may touch share a model
that is compiled when they meet. Clusters do not interact, so each is stepped through
an interval independently and keeps its states at the interval's moments.
"""

from collections.abc import Mapping, Sequence
from itertools import accumulate, chain

import mujoco
import numpy as np

from schema.errors import one_line
from schema.experiment.environment import gravity_vector
from schema.experiment.scenery import scenery_model
from schema.experiment.settings import ArenaSettings
from schema.robot.ids import BirthId
from schema.robot.robot import Robot
from schema.robot.trace import Floats
from worker.robot.placed import contact_reader
from worker.robot.recording import EngineView, probed_channels, step_with

NEVER = 1 << 62
"""A moment later than all others."""


class StateHistory:
    """A cluster's states at K moments of an interval, one row each.

    The states are columns of an array of all clusters, which need not be gathered.

    Attributes:
        state: (K, W) all of ``Cluster.live``, one array after another.
        warnings: (K, N) the engine's counts of each of its warnings.
        touching: pairs of members in contact, if they are recorded.
        probed: numbers of the members' probes, if there are any.
    """

    def __init__(self, cluster: "Cluster") -> None:
        warnings = cluster.data.warning.number
        # Copies between memory views are faster than between arrays, and one view of
        # all rows is faster than one of each, as few of them stay in the caches.
        self._live = [array.data for array in cluster.live]
        self._warnings = warnings.data
        self._positions = slice(0, cluster.model.nq)
        self._velocities = slice(cluster.model.nq, cluster.parts[2])
        self.state = np.zeros((0, cluster.size))
        self.warnings = np.zeros((0, len(warnings)), dtype=warnings.dtype)
        self.touching: list[list[tuple[int, int]]] = []
        self.probed: list[list[Floats]] = []

    @property
    def qpos(self) -> Floats:
        """Positions, (K, Q)."""
        return self.state[:, self._positions]

    @property
    def qvel(self) -> Floats:
        """Velocities, (K, V)."""
        return self.state[:, self._velocities]

    def move(self, states: Floats, start: int) -> None:
        """Move the rows to columns, from a first one, of an array of all clusters.

        The array is (K, at least W), K at least as great as before, and contiguous.
        """
        count, self._width = states.shape
        state = states[:, start : start + self.state.shape[1]]
        if new := count - len(self.state):
            added = np.zeros((new, self.warnings.shape[1]), self.warnings.dtype)
            self.warnings = np.concatenate((self.warnings, added))
            self._counts = self.warnings.reshape(-1).data
            self.touching += [[] for _ in range(new)]
            self.probed += [[] for _ in range(new)]
        state[: len(self.state)] = self.state
        self.state, self._start = state, start
        self._cells = states.reshape(-1).data

    def keep(self, moment: int) -> None:
        """Copy the present state and warnings to the rows of a moment."""
        at, cells = moment * self._width + self._start, self._cells
        for array in self._live:
            cells[at : (at := at + len(array))] = array
        at = moment * len(self._warnings)
        self._counts[at : at + len(self._warnings)] = self._warnings


class Cluster:
    """A model, its state and its robots, by birth.

    Attributes:
        members: births of its robots, ascending.
        views: of the members, in that order.
        live: the state as of the last step, live: positions, velocities, positions of
            all bodies and their rotations, each as one row of numbers.
        parts: where these four start in a row of all.
        size: W, numbers of the row.
        history: states at the moments of the last interval.
        cost: of a step, in arbitrary units; orders clusters for threads.
        failure: the engine's error; empty if there was none.
        failed_at: moment of the interval of that error.
        touched: geoms in contact in the last step; kept only if a member has touch
            sensors, or own ones.
        probes: of the members, in that order, if anything needs them.
    """

    def __init__(
        self,
        births: tuple[BirthId, ...],
        robots: Mapping[str, Robot],
        model: mujoco.MjModel,
        settings: ArenaSettings,
    ) -> None:
        """Create the state of a model, where prefixes of names tell robots apart."""
        self.members = births
        self.model, self.data = model, mujoco.MjData(model)
        self.views = tuple(
            EngineView(robot, model, self.data, settings, prefix)
            for prefix, robot in robots.items()
        )
        self._owners = [-1] * model.ngeom
        for number, view in enumerate(self.views):
            first, end = view.geoms
            self._owners[first:end] = [number] * (end - first)
        data = self.data
        arrays = (data.qpos, data.qvel, data.xpos, data.xmat)
        self.live: tuple[Floats, ...] = tuple(each.reshape(-1) for each in arrays)
        *starts, self.size = accumulate(map(len, self.live), initial=0)
        self.parts = tuple(starts)
        self.probes = [view.probe for view in self.views if view.probe is not None]
        has_work = "energy" in probed_channels(settings)
        self._working = self.probes if has_work else []
        self._contacts = contact_reader(model, self.data)
        self.history = StateHistory(self)
        self.cost = int(model.nv + 4 * model.ngeom)
        self.failure, self.failed_at = "", NEVER
        self.touched: frozenset[int] = frozenset()
        self._has_pads = any(
            view.sensors.pads or view.sensors.own for view in self.views
        )
        self._records_contacts = settings.arena.record_touches and len(births) > 1

    def run(self, plan: Sequence[int], first: int = 0) -> None:
        """Step the physics from moment to moment with constant commands.

        A plan has the steps to each moment from the one before; the rows before the
        first moment stay unchanged.
        """
        model, data, keep = self.model, self.data, self.history.keep
        # Looked up once, as this loop runs thousands of times a second.
        working, probes, records = self._working, self.probes, self._records_contacts
        for moment in range(first, len(plan)):
            try:
                step_with(working, model, data, plan[moment])
            except mujoco.FatalError as error:
                self.failure, self.failed_at = one_line(error), moment
                self.keep(range(moment, len(plan)))
                break
            keep(moment)
            if probes:
                for probe in probes:
                    probe.read()
                self._keep_probed(moment)
            if records:
                self.history.touching[moment] = self.touching()
        # A cluster formed at the last moment has its members' earlier contacts.
        if self._has_pads and first < len(plan):
            self.touched = frozenset(chain.from_iterable(self._contacts()))

    def keep(self, moments: range) -> None:
        """Copy the present state to the rows of some moments."""
        for moment in moments:
            self.history.keep(moment)
            self._keep_probed(moment)
            self.history.touching[moment] = self.touching()

    def drop_history(self) -> None:
        """Forget the history, as the array of all clusters may be large."""
        self.history = StateHistory(self)

    def _keep_probed(self, moment: int) -> None:
        numbers = [probe.numbers.copy() for probe in self.probes]
        self.history.probed[moment] = numbers

    def rewind(self, moment: int) -> None:
        """Set positions and velocities to those of a moment of the interval."""
        self.data.qpos[:] = self.history.qpos[moment]
        self.data.qvel[:] = self.history.qvel[moment]
        for probe, numbers in zip(
            self.probes, self.history.probed[moment], strict=True
        ):
            probe.numbers[:] = numbers

    def touching(self) -> list[tuple[int, int]]:
        """Return the pairs of members in contact in the last step, ascending."""
        if len(self.members) == 1 or not self.data.ncon:
            return []
        owners = self._owners
        # Plain numbers, as contacts are few and most of them with the ground.
        pairs = {(owners[first], owners[second]) for first, second in self._contacts()}
        return sorted({(min(p), max(p)) for p in pairs if p[0] != p[1] and min(p) >= 0})

    def change(self, settings: ArenaSettings) -> None:
        """Give the model the gravity, friction and torques of settings."""
        model, clock, world = self.model, settings.simulation, settings.environment
        model.opt.gravity = gravity_vector(world, clock.gravity)
        model.geom_friction[:, 0] = clock.friction
        if world.scenery:
            # Its geoms may have a friction of their own.
            own = scenery_model(world.scenery, clock).geom_friction
            first = int(model.geom("scenery/0").id)
            model.geom_friction[first : first + len(own)] = own
        for view in self.views:
            view.servos.limit(clock.torque_factor)

    def reset(self) -> None:
        """Reset the state to the model's initial one."""
        mujoco.mj_resetData(self.model, self.data)
        self.failure, self.failed_at = "", NEVER
