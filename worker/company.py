"""All robots of an arena and who of them lives together.

A robot that may touch another before the next look moves into one cluster with
it; a cluster of which parts have drifted apart falls into them. Everything goes by
birth, so that it does not depend on who came into memory when.
"""

from collections.abc import Iterable, Sequence

import mujoco
import numpy as np

from schema.birth import BirthId
from schema.evaluation import Floats
from schema.settings import ArenaSettings
from worker.cluster import Cluster
from worker.groups import Group, across, components
from worker.inhabitant import Inhabitant
from worker.layout import Layout, Roster
from worker.proximity import Proximity
from worker.shop import Shop
from worker.stride import Stride


class Company:
    """The living, by birth, and their clusters, by first member.

    Attributes:
        clusters: of all of them.
        by_cost: the same clusters, dearest first.
        layout: where their numbers stand.
        stride: the stretch of time that is being looked at; nothing between two.
        merges, splits: how often clusters were joined and parted.
    """

    def __init__(self, settings: ArenaSettings) -> None:
        """Start with nobody."""
        self.shop = Shop(settings)
        self.proximity = Proximity(settings)
        self.roster = Roster(())
        self.clusters: tuple[Cluster, ...] = ()
        self.by_cost: list[Cluster] = []
        self.layout = Layout((), self.roster)
        self.stride: Stride | None = None
        self.merges = self.splits = 0
        self._cluster_of: dict[BirthId, Cluster] = {}
        self._new: list[Cluster] = []

    @property
    def everybody(self) -> tuple[Inhabitant, ...]:
        """All inhabitants, by birth."""
        return self.roster.everybody

    def __contains__(self, birth: BirthId) -> bool:
        return birth in self.roster.rows

    def find(self, birth: BirthId) -> Inhabitant:
        """Return who has a name."""
        return self.roster.everybody[self.roster.rows[birth]]

    def cluster_of(self, birth: BirthId) -> Cluster:
        """Return where somebody lives."""
        return self._cluster_of[birth]

    def add(self, newcomers: Iterable[Inhabitant]) -> None:
        """Take robots in, each in its own home."""
        added = sorted(newcomers, key=lambda one: one.birth)
        self._anchor()
        everybody = sorted((*self.everybody, *added), key=lambda one: one.birth)
        self.roster = Roster(everybody)
        for one in added:
            self.proximity.insert(self.roster.rows[one.birth])
        homes = [one.body.home for one in added]
        self._settle([*self.clusters, *homes])

    def remove(self, births: Iterable[BirthId]) -> None:
        """Let robots go; those who lived with them stay together."""
        gone = sorted(births)
        if not gone:
            return
        self._anchor()
        self.proximity.remove([self.roster.rows[birth] for birth in gone])
        homes: dict[Group, Cluster] = {}
        for birth in gone:
            cluster = self._cluster_of[birth]
            homes[cluster.members] = cluster
        left = [one for one in self.everybody if one.birth not in gone]
        kept = [cluster for cluster in self.clusters if cluster.members not in homes]
        self.roster = Roster(left)
        for members in homes:
            rest = tuple(birth for birth in members if birth not in gone)
            if rest:
                kept.append(self._move(rest))
        for birth in gone:
            self.shop.forget(birth)
        self._settle(kept)

    def begin(self, plan: Sequence[int]) -> Stride:
        """Look, from now on, at a stretch that all clusters have gone through."""
        self.stride = Stride(tuple(plan))
        self.stride.read(self.layout)
        self.stride.measure(self.layout, self.proximity.anchor, 0)
        return self.stride

    def catch_up(self) -> None:
        """Let clusters that are new at this moment go through the rest, too."""
        stride = self.stride
        if stride is None or not self._new:
            return
        for cluster in self._new:
            cluster.run(stride.plan, stride.moment + 1)
        self._new = []
        stride.read(self.layout)
        stride.measure(self.layout, self.proximity.anchor, stride.moment + 1)

    def end(self) -> None:
        """Have looked at all of the stretch: now is its last moment."""
        self.stride, self._new = None, []

    def look(self) -> None:
        """Join those who may touch before the next look."""
        stride, layout, proximity = self.stride, self.layout, self.proximity
        if stride is None:
            state = layout.read()
            bounds = layout.bounds(np.abs(state - proximity.anchor))
        else:
            state = stride.state
            bounds = stride.bounds[stride.moment]
        is_anchored, pairs = proximity.look(layout, state, bounds, self._balls)
        if is_anchored and stride is not None:
            stride.measure(layout, proximity.anchor, stride.moment)
        if pairs:
            births = [one.birth for one in self.everybody]
            links = [(births[first], births[second]) for first, second in pairs]
            old = [cluster.members for cluster in self.clusters]
            self.regroup(components(old, links))

    def part(self) -> None:
        """Let clusters fall into those parts that have drifted apart."""
        groups: list[Group] = []
        for cluster in self.clusters:
            groups += self._parts(cluster) if len(cluster.members) > 1 else ()
        if groups:
            alone = [c.members for c in self.clusters if len(c.members) == 1]
            self.regroup([*alone, *groups])

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
            if not changed:
                self._anchor()
            changed = True
            before = sorted({self._cluster_of[birth].members for birth in members})
            self.merges += len(before) - 1
            torn += before if len(before) == 1 else ()
            rows = [self.roster.rows[birth] for birth in members]
            self.proximity.join(rows)
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
        if self.stride is not None:
            for birth in members:
                self._cluster_of[birth].rewind(self.stride.moment)
        cluster = self.shop.cluster(members, [one.body for one in people])
        for one, seat in zip(people, cluster.seats, strict=True):
            seat.take(one.seat)
            one.seat = seat
        return cluster

    def _settle(self, clusters: Sequence[Cluster]) -> None:
        known = {id(cluster) for cluster in self.clusters}
        rows = self.roster.rows
        self.clusters = tuple(sorted(clusters, key=lambda c: rows[c.members[0]]))
        self._cluster_of = {
            birth: cluster for cluster in self.clusters for birth in cluster.members
        }
        self.layout = Layout(self.clusters, self.roster)
        self.by_cost = sorted(self.clusters, key=lambda cluster: -cluster.cost)
        if self.stride is None:
            self.proximity.gather(self.layout, self.layout.read())
            return
        moment, count = self.stride.moment, len(self.stride.plan)
        for cluster in self.clusters:
            if id(cluster) not in known:
                cluster.keep(range(moment, count))
                self._new.append(cluster)
        self.stride.read(self.layout)
        self.proximity.gather(self.layout, self.stride.state.copy())
        self.stride.measure(self.layout, self.proximity.anchor, moment)

    def _anchor(self) -> None:
        """Note how far all have moved, before they stand elsewhere in the layout."""
        if self.stride is not None:
            self.proximity.settle(self.stride.bounds[self.stride.moment, 0])
            return
        differences = np.abs(self.layout.read() - self.proximity.anchor)
        self.proximity.settle(self.layout.bounds(differences)[0])

    def _parts(self, cluster: Cluster) -> list[Group]:
        """Return the parts of a cluster, one if it holds together."""
        alone = [(birth,) for birth in cluster.members]
        touching = [
            (cluster.members[a], cluster.members[b]) for a, b in cluster.touching()
        ]
        groups = components(alone, touching)
        if len(groups) == 1:
            return groups
        pairs = across([[self.roster.rows[b] for b in group] for group in groups])
        births = [one.birth for one in self.everybody]
        near = self.proximity.near(pairs, self._balls)
        links = [(births[first], births[second]) for first, second in near]
        groups = components(groups, links)
        for group in groups:
            self.proximity.join([self.roster.rows[birth] for birth in group])
        return groups

    def _balls(self, row: int) -> Floats:
        """Return the spheres that cover a robot, (3, B), world frame [m]."""
        one = self.everybody[row]
        reach, seat = one.body.reach, one.seat
        xpos, xmat = seat.xpos, seat.xmat
        if self.stride is not None:
            track, moment = self._cluster_of[one.birth].track, self.stride.moment
            xpos, xmat = (
                track.xpos[moment, seat.bodies],
                track.xmat[moment, seat.bodies],
            )
        turned = xmat[reach.bodies] * reach.centres
        moved = turned[:, 0::3] + turned[:, 1::3] + turned[:, 2::3]
        return np.asarray((moved + xpos[reach.bodies]).T)
