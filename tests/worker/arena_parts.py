"""An arena in parts, advanced in one process; its oracle is the arena as a whole."""

from collections import Counter
from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass, field
from functools import partial
from itertools import chain, combinations
from typing import Any

from msgspec.structs import replace

from schema.experiment.settings import ArenaSettings
from schema.robot.groups import Group, connected_components
from schema.robot.ids import BirthId
from schema.wire.arena import Advance, Box, Casualty, Changes, Judgement
from schema.wire.arena_state import ArenaState, states_of
from schema.wire.codec import encode
from schema.wire.poses import PoseArrays
from worker.arena.world import World

Home = Callable[[Group], int]
"""Returns the number of the part that gets a cluster."""
Go = Callable[[World], Advance]
"""Advances a part."""


@dataclass
class Run:
    """A world that was advanced, and the robots that it answers for."""

    world: World
    births: frozenset[BirthId]
    advance: Advance

    @property
    def boxes(self) -> dict[BirthId, Box]:
        """Boxes swept by its robots."""
        return {b: box for b, box in self.world.swept.items() if b in self.births}


@dataclass
class Outcome:
    """What happens in an arena, in a form that does not depend on its parts.

    Attributes:
        touches: numbers of checks at which two robots were in contact.
        work_j: of the living robots since the beginning of the advance.
    """

    digest: bytes = b""
    judgements: list[Judgement] = field(default_factory=list)
    casualties: list[Casualty] = field(default_factory=list)
    touches: Counter[tuple[BirthId, BirthId]] = field(default_factory=Counter)
    work_j: dict[BirthId, float] = field(default_factory=dict)
    poses: list[tuple[float, BirthId, Any]] = field(default_factory=list)

    def add(self, runs: Sequence[Run], interval_s: float) -> None:
        """Add what happened in an exchange."""
        self.work_j = {}
        for run in runs:
            advance, births = run.advance, run.births
            self.judgements += [e for e in advance.judgements if e.birth in births]
            self.casualties += [e for e in advance.casualties if e.birth in births]
            for each in advance.touches:
                count = round(each.duration_s / interval_s)
                self.touches[each.first, each.second] += count * (each.first in births)
            work = zip(run.world.births, advance.work_j, strict=True)
            self.work_j |= {birth: work_j for birth, work_j in work if birth in births}
            arrays = PoseArrays.received(advance.poses)
            rows = [tuple(row.values()) for row in arrays.rows().to_pylist()]
            samples = zip(arrays.times_s.tolist(), arrays.robots, rows, strict=True)
            self.poses += [sample for sample in samples if sample[1] in births]
        self.judgements.sort(key=lambda each: each.birth)
        self.casualties.sort(key=lambda each: (each.step, each.birth))
        self.poses.sort(key=lambda sample: sample[:2])
        self.touches = +self.touches


class Parts:
    """Worlds that are one arena together; robots move between them.

    Attributes:
        repeats: how often robots of several parts were advanced again together.
    """

    def __init__(self, settings: ArenaSettings, count: int) -> None:
        self.worlds = [World(settings) for _ in range(count)]
        self.repeats = 0
        self._settings = settings
        clock = settings.simulation
        self._interval_s = settings.arena.proximity_steps * clock.timestep_s

    def state(self) -> ArenaState:
        """Return the state of all robots, as if it were one world's."""
        states = [world.state() for world in self.worlds]
        robots = sorted(chain.from_iterable(state.robots for state in states))
        clusters = sorted(chain.from_iterable(state.clusters for state in states))
        return replace(states[0], robots=tuple(robots), clusters=tuple(clusters))

    def advance(self, changes: Changes, stops: Sequence[int], home: Home) -> Outcome:
        """Change the arena, then advance it through exchanges that end at stops."""
        outcome = Outcome()
        for until in stops:
            self._move(home)
            work_j, judges = outcome.work_j, until == stops[-1]
            go = partial(World.advance, until=until, work_j=work_j, judges=judges)
            runs = self._exchange(changes, home, go)
            outcome.add(runs, self._interval_s)
            self._settle(runs, home)
            changes = Changes()
        outcome.digest = self.state().digest
        return outcome

    def _move(self, home: Home) -> None:
        """Give each cluster to its part."""
        for number, world in enumerate(self.worlds):
            for cluster in world.state().clusters:
                if home(cluster) != number:
                    state = states_of(world.state(), cluster)
                    world.apply(Changes(removals=cluster))
                    self.worlds[home(cluster)].take_in(state)

    def _exchange(self, changes: Changes, home: Home, go: Go) -> list[Run]:
        """Advance all parts; robots in reach of other parts again, until none is."""
        start, newborn = self.state(), [(each.birth,) for each in changes.insertions]
        groups = [*start.clusters, *newborn]
        runs = []
        for number, world in enumerate(self.worlds):
            births = {*world.births, *(b for (b,) in newborn if home((b,)) == number)}
            runs.append(_run(world, births, changes, go))
        while joint := _in_reach(groups, runs):
            self.repeats += 1
            groups.append(joint)
            for run in runs:
                run.births -= {*joint}
            state = replace(
                start,
                robots=tuple(each for each in start.robots if each[0] in joint),
                clusters=tuple(each for each in start.clusters if each[0] in joint),
            )
            world = World.restore(self._settings, encode(state))
            runs.append(_run(world, joint, changes, go))
        return runs

    def _settle(self, runs: Sequence[Run], home: Home) -> None:
        """Give robots that were advanced again to a part."""
        for run in runs[len(self.worlds) :]:
            for world in self.worlds:
                held = run.births.intersection(world.births)
                world.apply(Changes(removals=tuple(sorted(held))))
            living = run.births.intersection(run.world.births)
            if living:
                state = states_of(run.world.state(), living)
                self.worlds[home(state.clusters[0])].take_in(state)


def _run(world: World, births: Collection[BirthId], changes: Changes, go: Go) -> Run:
    """Change the robots of a part as the arena is changed, and advance it."""
    own = Changes(
        tuple(birth for birth in changes.removals if birth in births),
        tuple(each for each in changes.insertions if each.birth in births),
        tuple(each for each in changes.brains if each.birth in births),
    )
    world.apply(own)
    if changes.insertions and not own.insertions:
        world.check_merges()
    return Run(world, frozenset(births), go(world))


def _in_reach(groups: Sequence[Group], runs: Sequence[Run]) -> Group:
    """Return robots of several parts in reach of each other, with all near them."""
    boxes = {b: box for run in runs for b, box in run.boxes.items()}
    pairs = combinations(sorted(boxes), 2)
    near = [(a, b) for a, b in pairs if overlap(boxes[a], boxes[b])]
    number_of = {b: number for number, run in enumerate(runs) for b in run.births}
    for group in connected_components(groups, near):
        if len({number_of[birth] for birth in group}) > 1:
            return group
    return ()


def overlap(first: Box, second: Box) -> bool:
    """Return whether two boxes have a point in common."""
    (w, s, e, n), (west, south, east, north) = first, second
    return w <= east and west <= e and s <= north and south <= n
