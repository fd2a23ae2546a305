"""All robots of an arena and who of them lives together.

A robot that may touch another before the next look moves into one cluster with
it; a cluster of which parts have drifted apart falls into them. Everything goes by
birth, so that it does not depend on who came into memory when.
"""

from collections.abc import Iterable, Sequence

import mujoco
import numpy as np

from schema.experiment.settings import ArenaSettings
from schema.robot.ids import BirthId
from schema.robot.results import Floats
from worker.clusters.cluster import Cluster
from worker.clusters.columns import Layout, RobotRows
from worker.clusters.connected_components import Group, across, connected_components
from worker.clusters.models import ModelCache
from worker.clusters.proximity import Pairs, Proximity, Scene
from worker.clusters.robot import ArenaRobot
from worker.clusters.rollout import Rollout


class ArenaPopulation:
    """The living, by birth, and their clusters, by first member.

    Attributes:
        clusters: of all of them.
        by_cost: the same clusters, dearest first.
        layout: where their numbers stand.
        rollout: the stretch of time that is being looked at; nothing between two.
        merges, splits: how often clusters were joined and parted.
    """

    def __init__(self, settings: ArenaSettings) -> None:
        """Start with nobody."""
        self.model_cache = ModelCache(settings)
        self.proximity = Proximity(settings)
        self.robot_rows = RobotRows(())
        self.clusters: tuple[Cluster, ...] = ()
        self.by_cost: list[Cluster] = []
        self.layout = Layout((), self.robot_rows)
        self.rollout: Rollout | None = None
        self.merges = self.splits = 0
        self._cluster_of: dict[BirthId, Cluster] = {}
        self._new: list[Cluster] = []

    @property
    def everybody(self) -> tuple[ArenaRobot, ...]:
        """All inhabitants, by birth."""
        return self.robot_rows.everybody

    def __contains__(self, birth: BirthId) -> bool:
        return birth in self.robot_rows.rows

    def find(self, birth: BirthId) -> ArenaRobot:
        """Return who has a name."""
        return self.robot_rows.everybody[self.robot_rows.rows[birth]]

    def cluster_of(self, birth: BirthId) -> Cluster:
        """Return where somebody lives."""
        return self._cluster_of[birth]

    def add(self, newcomers: Iterable[ArenaRobot]) -> None:
        """Take robots in, each in its own home."""
        added = sorted(newcomers, key=lambda one: one.birth)
        everybody = sorted((*self.everybody, *added), key=lambda one: one.birth)
        self.robot_rows = RobotRows(everybody)
        homes = [one.body.home for one in added]
        self._settle([*self.clusters, *homes])

    def remove(self, births: Iterable[BirthId]) -> None:
        """Let robots go; those who lived with them stay together."""
        gone = sorted(births)
        if not gone:
            return
        homes: dict[Group, Cluster] = {}
        for birth in gone:
            cluster = self._cluster_of[birth]
            homes[cluster.members] = cluster
        left = [one for one in self.everybody if one.birth not in gone]
        kept = [cluster for cluster in self.clusters if cluster.members not in homes]
        self.robot_rows = RobotRows(left)
        for members in homes:
            rest = tuple(birth for birth in members if birth not in gone)
            if rest:
                home = self._move(rest)
                mujoco.mj_kinematics(home.model, home.data)
                kept.append(home)
        for birth in gone:
            self.model_cache.forget(birth)
        self._settle(kept)

    def begin(self, plan: Sequence[int], looks: Sequence[bool]) -> Rollout:
        """Look, from now on, at a stretch that all clusters have gone through.

        Args:
            plan: steps to each moment from the one before.
            looks: whether it is looked then who may touch whom.
        """
        self.rollout = Rollout(tuple(plan), tuple(looks))
        self.rollout.read(self.layout)
        return self.rollout

    def catch_up(self) -> None:
        """Let clusters that are new at this moment go through the rest, too."""
        rollout = self.rollout
        if rollout is None or not self._new:
            return
        for cluster in self._new:
            cluster.run(rollout.plan, rollout.moment + 1)
        self._new = []
        rollout.read(self.layout)

    def end(self) -> None:
        """Have looked at all of the stretch: now is its last moment."""
        self.rollout, self._new = None, []

    def look(self) -> None:
        """Join those who may touch before the next look."""
        if self.rollout is None:
            scene = Scene(self.layout, self.layout.read()[np.newaxis])
            pairs = self.proximity.meetings(scene)[0]
        else:
            pairs = self._meetings(self.rollout)
        if pairs:
            old = [cluster.members for cluster in self.clusters]
            self.regroup(connected_components(old, self._links(pairs)))

    def part(self, state: Floats) -> None:
        """Let clusters fall into those parts that have drifted apart.

        Args:
            state: what all are like now, (W,) as the layout puts them.
        """
        groups: list[Group] = []
        pairs: Pairs = []
        for cluster in self.clusters:
            parts = cluster.parts()
            groups += parts
            if len(parts) > 1:
                rows = self.robot_rows.rows
                pairs += across([[rows[birth] for birth in part] for part in parts])
        if pairs:
            scene = Scene(self.layout, state[np.newaxis])
            near = self.proximity.near(scene, pairs)
            self.regroup(connected_components(groups, self._links(near)))

    def regroup(self, groups: Iterable[Group]) -> None:
        """Have exactly these groups live together, each ascending by birth."""
        present = {cluster.members: cluster for cluster in self.clusters}
        settled: list[Cluster] = []
        torn: list[Group] = []
        changed = False
        for members in groups:
            if members in present:
                settled.append(present[members])
                continue
            changed = True
            before = sorted({self._cluster_of[birth].members for birth in members})
            self.merges += len(before) - 1
            torn += before if len(before) == 1 else ()
            settled.append(self._move(members))
        self.splits += len(torn) - len(set(torn))
        if changed:
            self._settle(settled)

    def kinematics(self) -> None:
        """Bring the frames of all bodies up to the present state."""
        for cluster in self.clusters:
            mujoco.mj_kinematics(cluster.model, cluster.data)

    def _move(self, members: Group) -> Cluster:
        """Return a cluster into which robots have moved with their states."""
        people = [self.find(birth) for birth in members]
        if self.rollout is not None:
            for birth in members:
                self._cluster_of[birth].rewind(self.rollout.moment)
        cluster = self.model_cache.cluster(members, [one.body for one in people])
        for one, view in zip(people, cluster.views, strict=True):
            view.take(one.view)
            one.view = view
        return cluster

    def _settle(self, clusters: Sequence[Cluster]) -> None:
        known = {id(cluster) for cluster in self.clusters}
        rows = self.robot_rows.rows
        self.clusters = tuple(sorted(clusters, key=lambda c: rows[c.members[0]]))
        self._cluster_of = {
            birth: cluster for cluster in self.clusters for birth in cluster.members
        }
        self.layout = Layout(self.clusters, self.robot_rows)
        self.by_cost = sorted(self.clusters, key=lambda cluster: -cluster.cost)
        if self.rollout is None:
            return
        moment, count = self.rollout.moment, len(self.rollout.plan)
        for cluster in self.clusters:
            if id(cluster) not in known:
                cluster.keep(range(moment, count))
                self._new.append(cluster)
        self.rollout.read(self.layout)

    def _meetings(self, rollout: Rollout) -> Pairs:
        """Return who is to meet at this look; find it out for all that follow."""
        if rollout.moment not in rollout.meetings:
            looks = rollout.looks_ahead()
            scene = Scene(self.layout, rollout.states[looks])
            found = self.proximity.meetings(scene)
            rollout.meetings = dict(zip(looks, found, strict=True))
        return rollout.meetings[rollout.moment]

    def _links(self, pairs: Pairs) -> list[tuple[BirthId, BirthId]]:
        """Return the names of pairs of rows."""
        births = [one.birth for one in self.everybody]
        return [(births[here], births[there]) for here, there in pairs]
