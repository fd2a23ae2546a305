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
from worker.cluster import Cluster, Shop
from worker.inhabitant import Inhabitant
from worker.layout import Layout
from worker.proximity import Proximity

Group = tuple[BirthId, ...]


class Company:
    """The living, by birth, and their clusters, by first member.

    Attributes:
        everybody: all inhabitants, by birth.
        clusters: of all of them.
        by_cost: the same clusters, dearest first.
        layout: where their numbers stand.
        merges, splits: how often clusters were joined and parted.
    """

    def __init__(self, settings: ArenaSettings) -> None:
        """Start with nobody."""
        self.shop = Shop(settings)
        self.proximity = Proximity(settings)
        self.everybody: tuple[Inhabitant, ...] = ()
        self.clusters: tuple[Cluster, ...] = ()
        self.merges = self.splits = 0
        self._rows: dict[BirthId, int] = {}
        self._cluster_of: dict[BirthId, Cluster] = {}
        self.by_cost: list[Cluster] = []
        self.layout = Layout((), ())

    def __contains__(self, birth: BirthId) -> bool:
        return birth in self._rows

    def find(self, birth: BirthId) -> Inhabitant:
        """Return who has a name."""
        return self.everybody[self._rows[birth]]

    def cluster_of(self, birth: BirthId) -> Cluster:
        """Return where somebody lives."""
        return self._cluster_of[birth]

    def add(self, newcomers: Iterable[Inhabitant]) -> None:
        """Take robots in, each in its own home."""
        added = sorted(newcomers, key=lambda one: one.birth)
        self._anchor()
        self._number(sorted((*self.everybody, *added), key=lambda one: one.birth))
        for one in added:
            self.proximity.insert(self._rows[one.birth])
        homes = [one.body.home for one in added]
        self._settle([*self.clusters, *homes])

    def remove(self, births: Iterable[BirthId]) -> None:
        """Let robots go; those who lived with them stay together."""
        gone = sorted(births)
        if not gone:
            return
        self._anchor()
        self.proximity.remove([self._rows[birth] for birth in gone])
        homes: dict[Group, Cluster] = {}
        for birth in gone:
            cluster = self._cluster_of[birth]
            homes[cluster.members] = cluster
        left = [one for one in self.everybody if one.birth not in gone]
        kept = [cluster for cluster in self.clusters if cluster.members not in homes]
        self._number(left)
        for members in homes:
            rest = tuple(birth for birth in members if birth not in gone)
            if rest:
                kept.append(self._move(rest))
        for birth in gone:
            self.shop.forget(birth)
        self._settle(kept)

    def look(self, state: Floats, differences: Floats) -> None:
        """Join those who may touch before the next look.

        Args:
            state: of all clusters, as the layout reads it.
            differences: from the anchor of ``proximity``, absolute.
        """
        pairs = self.proximity.look(self.layout, state, differences, self._balls)
        if not pairs:
            return
        births = [one.birth for one in self.everybody]
        links = [(births[first], births[second]) for first, second in pairs]
        old = [cluster.members for cluster in self.clusters]
        self.regroup(_components(old, links))

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
            rows = [self._rows[birth] for birth in members]
            self.proximity.join(rows)
            settled.append(self._move(members))
        self.splits += len(torn) - len(set(torn))
        if changed:
            self._settle(settled)

    def differences(self, state: Floats) -> Floats:
        """Return how a state differs from what distances were measured in."""
        return np.abs(state - self.proximity.anchor)

    def kinematics(self) -> None:
        """Bring the frames of all bodies up to the present state."""
        for cluster in self.clusters:
            mujoco.mj_kinematics(cluster.model, cluster.data)

    def _move(self, members: Group) -> Cluster:
        """Return a cluster into which robots have moved with their states."""
        people = [self.find(birth) for birth in members]
        cluster = self.shop.cluster(members, [one.body for one in people])
        for one, seat in zip(people, cluster.seats, strict=True):
            seat.take(one.seat)
            one.seat = seat
        return cluster

    def _settle(self, clusters: Sequence[Cluster]) -> None:
        self.clusters = tuple(sorted(clusters, key=lambda cluster: cluster.members))
        self._cluster_of = {
            birth: cluster for cluster in self.clusters for birth in cluster.members
        }
        self.layout = Layout(self.clusters, self.everybody)
        self.by_cost = sorted(self.clusters, key=lambda cluster: -cluster.cost)
        reaches = [one.body.reach for one in self.everybody]
        self.proximity.gather(reaches, self.layout)

    def _anchor(self) -> None:
        """Note how far all have moved, before they stand elsewhere in the layout."""
        moved, _ = self.layout.bounds(self.differences(self.layout.read()))
        self.proximity.settle(moved)

    def _number(self, everybody: Sequence[Inhabitant]) -> None:
        self.everybody = tuple(everybody)
        self._rows = {one.birth: row for row, one in enumerate(everybody)}

    def _parts(self, cluster: Cluster) -> list[Group]:
        """Return the parts of a cluster, one if it holds together."""
        alone = [(birth,) for birth in cluster.members]
        touching = [
            (cluster.members[a], cluster.members[b]) for a, b in cluster.touching()
        ]
        groups = _components(alone, touching)
        if len(groups) == 1:
            return groups
        pairs = _across([[self._rows[b] for b in group] for group in groups])
        births = [one.birth for one in self.everybody]
        near = self.proximity.near(pairs, self._balls)
        links = [(births[first], births[second]) for first, second in near]
        groups = _components(groups, links)
        for group in groups:
            self.proximity.join([self._rows[birth] for birth in group])
        return groups

    def _balls(self, row: int) -> Floats:
        """Return the spheres that cover a robot, (3, B), world frame [m]."""
        one = self.everybody[row]
        reach, seat = one.body.reach, one.seat
        turned = seat.xmat[reach.bodies] * reach.centres
        moved = turned[:, 0::3] + turned[:, 1::3] + turned[:, 2::3]
        return np.asarray((moved + seat.xpos[reach.bodies]).T)


def _across(groups: Sequence[Sequence[int]]) -> list[tuple[int, int]]:
    """Return the pairs of rows whose ends are in two groups, lesser row first."""
    return sorted(
        (min(a, b), max(a, b))
        for number, group in enumerate(groups)
        for other in groups[number + 1 :]
        for a in group
        for b in other
    )


def _components(
    groups: Iterable[Group], links: Iterable[tuple[BirthId, BirthId]]
) -> list[Group]:
    """Return groups joined along links, each and all ascending."""
    parent: dict[BirthId, BirthId] = {}
    for group in groups:
        for birth in group:
            parent[birth] = group[0]

    def root(birth: BirthId) -> BirthId:
        while parent[birth] != birth:
            birth = parent[birth]
        return birth

    for first, second in links:
        ends = sorted((root(first), root(second)))
        parent[ends[1]] = ends[0]
    found: dict[BirthId, list[BirthId]] = {}
    for birth in sorted(parent):
        found.setdefault(root(birth), []).append(birth)
    return [tuple(found[first]) for first in sorted(found)]
