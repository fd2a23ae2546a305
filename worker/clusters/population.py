"""The living robots of an arena and their clusters.

Robots that may touch before the next check are merged into one cluster; a cluster
whose parts have drifted apart is split. Everything is ordered by birth, so results
do not depend on the order of insertions.
"""

from collections.abc import Iterable, Mapping, Sequence

import mujoco
import numpy as np

from schema.experiment.settings import ArenaSettings
from schema.parts import Vector
from schema.robot.groups import Group, Links, connected_components
from schema.robot.ids import BirthId
from schema.robot.trace import Floats
from worker.clusters.cluster import Cluster
from worker.clusters.models import ModelCache
from worker.clusters.proximity import Proximity, RobotBounds
from worker.clusters.robot import ArenaRobot
from worker.clusters.states import (
    PLAUSIBLE,
    Layout,
    Pairs,
    RobotRows,
    Rollout,
    Schedule,
    StateColumns,
)


class ArenaPopulation:
    """The living robots, by birth, and their clusters, by first member.

    Attributes:
        robot_rows: the living robots and their indices.
        clusters: of all of them.
        by_cost: the same clusters, most expensive first.
        rollout: the interval that is being handled; None between two intervals.
        proximity: the test for merges and splits.
        patch_lights: positions of the lights of patches [m].
    """

    def __init__(self, settings: ArenaSettings) -> None:
        self.model_cache = ModelCache(settings)
        self._number(())
        self.clusters: tuple[Cluster, ...] = ()
        self.by_cost: list[Cluster] = []
        self.cluster_of: dict[BirthId, Cluster] = {}
        self._columns = StateColumns(Schedule(settings).most_moments)
        self.layout = Layout((), self.robot_rows, self._columns)
        self.rollout: Rollout | None = None
        self.patch_lights: tuple[Vector, ...] = ()
        self.proximity = Proximity(settings)
        self._new: list[Cluster] = []

    def __contains__(self, birth: BirthId) -> bool:
        return birth in self.robot_rows.rows

    def find(self, birth: BirthId) -> ArenaRobot:
        """Return the robot of a birth."""
        return self.robot_rows.robots[self.robot_rows.rows[birth]]

    def add(self, newborn: Iterable[ArenaRobot]) -> None:
        """Add robots, each in its own cluster."""
        added = sorted(newborn, key=lambda robot: robot.birth)
        robots = sorted((*self.robots, *added), key=lambda robot: robot.birth)
        self._number(robots)
        self._settle([*self.clusters, *(robot.body.solo for robot in added)])

    def remove(self, births: Iterable[BirthId]) -> None:
        """Remove robots; the other members of their clusters stay together."""
        gone = set(births)
        if not gone:
            return
        left = [robot for robot in self.robots if robot.birth not in gone]
        self._number(left)
        kept: list[Cluster] = []
        for cluster in self.clusters:
            rest = tuple(birth for birth in cluster.members if birth not in gone)
            if rest == cluster.members:
                kept.append(cluster)
            elif rest:
                moved = self._move(rest)
                mujoco.mj_kinematics(moved.model, moved.data)
                kept.append(moved)
        for birth in sorted(gone):
            self.model_cache.forget(birth)
        self._settle(kept)

    def change(self, settings: ArenaSettings) -> None:
        """Give the world of all robots, also of later ones, other settings."""
        self.model_cache.present = settings
        for cluster in self.clusters:
            cluster.change(settings)
        for robot in self.robots:
            robot.body.channels.light = settings.light

    def begin(self, plan: Sequence[int], is_merge: Sequence[bool]) -> Rollout:
        """Start to handle an interval that all clusters have been stepped through."""
        self.rollout = Rollout(tuple(plan), tuple(is_merge))
        self.rollout.read(self.layout)
        return self.rollout

    def catch_up(self) -> None:
        """Step clusters formed at the present moment to the end of the interval."""
        rollout = self.rollout
        if rollout is None or not self._new:
            return
        for cluster in self._new:
            cluster.run(rollout.plan, rollout.moment + 1)
        self._new = []
        rollout.read(self.layout)

    def end(self) -> None:
        """Finish the interval."""
        self.rollout, self._new = None, []

    def merge(self) -> None:
        """Merge the clusters of robots that may touch before the next check."""
        if self.rollout is None:
            bounds = RobotBounds(self.layout, self.layout.read()[np.newaxis])
            pairs = self.proximity.pairs_to_merge(bounds)[0]
        else:
            pairs = self._merge_pairs(self.rollout)
        if pairs:
            old = [cluster.members for cluster in self.clusters]
            self.regroup(connected_components(old, self._links(pairs)))

    def split(self, state: Floats) -> None:
        """Split clusters whose parts have drifted apart.

        ``state`` is the present one, (W,) in the order of the layout.
        """
        rows = self.robot_rows.rows
        groups: list[Group] = []
        pairs: Pairs = []
        for cluster in self.clusters:
            members = cluster.members
            links = [(members[a], members[b]) for a, b in cluster.touching()]
            parts = connected_components([(birth,) for birth in members], links)
            groups += parts
            pairs += sorted(
                (min(rows[a], rows[b]), max(rows[a], rows[b]))
                for number, part in enumerate(parts)
                for other in parts[number + 1 :]
                for a in part
                for b in other
            )
        if pairs:
            bounds = RobotBounds(self.layout, state[np.newaxis])
            near = self.proximity.pairs_to_keep(bounds, pairs)
            self.regroup(connected_components(groups, self._links(near)))

    def regroup(self, groups: Iterable[Group]) -> None:
        """Form exactly these clusters, each ascending by birth."""
        present = {cluster.members: cluster for cluster in self.clusters}
        settled: list[Cluster] = []
        for members in groups:
            is_there = members in present
            settled.append(present.pop(members) if is_there else self._move(members))
        if present:
            self._settle(settled)

    def kinematics(self) -> None:
        """Compute the frames of all bodies from the present state."""
        for cluster in self.clusters:
            mujoco.mj_kinematics(cluster.model, cluster.data)

    def _number(self, robots: Sequence[ArenaRobot]) -> None:
        """Replace the robots, ordered by birth."""
        self.robot_rows = RobotRows(robots)
        self.robots = self.robot_rows.robots

    def _move(self, births: Group) -> Cluster:
        """Return a cluster into which robots have moved with their states."""
        robots = [self.find(birth) for birth in births]
        if self.rollout is not None:
            for birth in births:
                self.cluster_of[birth].rewind(self.rollout.moment)
        cluster = self.model_cache.cluster(births, [robot.body for robot in robots])
        touched: set[int] = set()
        for robot, view in zip(robots, cluster.views, strict=True):
            before = self.cluster_of[robot.birth].touched
            touched |= view.touched_of(robot.view, before)
            view.copy_from(robot.view)
            robot.view = view
        cluster.touched = frozenset(touched)
        return cluster

    def _settle(self, clusters: Sequence[Cluster]) -> None:
        """Replace the clusters; record the state of new ones from now on."""
        known, rows, before = set(self.clusters), self.robot_rows.rows, self.cluster_of
        gone = known.difference(clusters)
        self._new = [cluster for cluster in self._new if cluster not in gone]
        self.clusters = tuple(sorted(clusters, key=lambda c: rows[c.members[0]]))
        self.cluster_of = {
            birth: cluster for cluster in self.clusters for birth in cluster.members
        }
        self.layout = Layout(self.clusters, self.robot_rows, self._columns)
        self.by_cost = sorted(self.clusters, key=lambda cluster: -cluster.cost)
        if self.rollout is not None:
            moment, count = self.rollout.moment, len(self.rollout.plan)
            for cluster in self.clusters:
                if cluster not in known:
                    cluster.keep(range(moment, count))
                    touching = _touching(cluster.members, before, moment)
                    cluster.history.touching[moment] = touching
                    self._new.append(cluster)
            self.rollout.read(self.layout)
        for cluster in gone:
            cluster.drop_history()

    def _merge_pairs(self, rollout: Rollout) -> Pairs:
        """Return the pairs to merge now; computes them for all checks ahead."""
        if rollout.moment not in rollout.merge_pairs:
            is_broken = not rollout.max_velocity <= PLAUSIBLE
            now = rollout.moment
            # Only the present moment if the physics breaks in the interval.
            ahead = range(now, now + 1 if is_broken else rollout.after_merges)
            span = slice(ahead.start, ahead.stop)
            bounds = RobotBounds(
                self.layout, rollout.states[span], rollout.velocities[span]
            )
            found = self.proximity.pairs_to_merge(bounds)
            rollout.merge_pairs = dict(zip(ahead, found, strict=True))
        return rollout.merge_pairs[rollout.moment]

    def _links(self, pairs: Pairs) -> Links:
        """Return the births of pairs of rows."""
        return [(self.robots[a].birth, self.robots[b].birth) for a, b in pairs]


def _touching(
    members: Group, cluster_of: Mapping[BirthId, Cluster], moment: int
) -> list[tuple[int, int]]:
    """Return pairs of members of a new cluster that touched in their former ones."""
    index_of = {birth: index for index, birth in enumerate(members)}
    pairs: list[tuple[int, int]] = []
    for former in dict.fromkeys(cluster_of[birth] for birth in members):
        for touching in former.history.touching[moment]:
            first, second = (former.members[index] for index in touching)
            if first in index_of and second in index_of:
                pairs.append((index_of[first], index_of[second]))
    return sorted(pairs)
