"""Properties of clusters: partitions, symmetry, and states that moves do not change."""

from itertools import combinations
from random import Random

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.strategies import DataObject
from msgspec.structs import replace

from schema.parts import Vector
from schema.robot.groups import Group, connected_components, overlaps
from schema.robot.ids import BirthId
from schema.wire.arena import Changes
from tests.worker.arena_cases import (
    SETTINGS,
    counted,
    crowd,
    populated,
    settings_of,
    state_of,
)
from tests.worker.clusters.invariants import check_population
from tests.worker.conftest import random_robot
from worker.arena.world import World
from worker.clusters.proximity import Proximity, RobotBounds
from worker.clusters.states import MERGES_PER_SPLIT, Schedule, StateColumns, runs

BIRTHS = [BirthId(number % 2, number) for number in range(8)]
births = st.sampled_from(BIRTHS)
links = st.lists(st.tuples(births, births), max_size=10)
few = settings(max_examples=12, deadline=None)
many = settings(max_examples=100, deadline=None)


def partition(data: DataObject, members: tuple[BirthId, ...]) -> list[Group]:
    """Draw a partition of births into groups, each and all ascending."""
    labels = data.draw(
        st.lists(st.integers(0, 3), min_size=len(members), max_size=len(members))
    )
    groups: dict[int, list[BirthId]] = {}
    for birth, label in zip(members, labels, strict=True):
        groups.setdefault(label, []).append(birth)
    return sorted(tuple(sorted(group)) for group in groups.values())


# --- groups ------------------------------------------------------------------


@many
@given(pairs=links, order=st.randoms(use_true_random=False))
def test_components_are_a_partition_in_which_exactly_links_join(
    pairs: list[tuple[BirthId, BirthId]], order: Random
) -> None:
    """Two births are in one group exactly if a way of links leads between them."""
    found = connected_components([(birth,) for birth in BIRTHS], pairs)
    assert sorted(birth for group in found for birth in group) == sorted(BIRTHS)
    assert found == sorted(tuple(sorted(group)) for group in found)
    group_of = {birth: group for group in found for birth in group}
    assert all(group_of[first] == group_of[second] for first, second in pairs)
    reached = {birth: {birth} for birth in BIRTHS}
    for _ in BIRTHS:
        for first, second in pairs:
            joined = reached[first] | reached[second]
            reached[first], reached[second] = joined, joined
    assert all(set(group_of[birth]) == reached[birth] for birth in BIRTHS)
    mixed = [pair[::-1] for pair in pairs]
    order.shuffle(mixed)
    assert connected_components(found, mixed) == found


# --- states ------------------------------------------------------------------


@few
@given(data=st.data())
def test_merging_and_splitting_returns_all_states(data: DataObject) -> None:
    """To the last bit, whatever groups the robots pass through."""
    world = populated(settings_of(drop_m=0.05), crowd(random_robot, 6, 0.6))
    world.advance(data.draw(st.integers(1, 200)))
    population, members = world.population, world.births
    first = [cluster.members for cluster in population.clusters]

    def states() -> dict[BirthId, tuple[bytes, list[Vector], list[int]]]:
        """Return state, sensors' memory and touching parts of each robot."""
        found = {}
        for birth in members:
            view = population.find(birth).view
            start, end = view.geoms
            touched = population.cluster_of[birth].touched
            parts = sorted(g - start for g in touched if start <= g < end)
            found[birth] = state_of(world, birth), [*view.sensors.velocities], parts
        return found

    before = states()
    for _ in range(data.draw(st.integers(1, 3))):
        groups = partition(data, members)
        population.regroup(groups)
        assert [cluster.members for cluster in population.clusters] == groups
        check_population(population)
        assert states() == before
    population.regroup(first)
    assert states() == before
    world.close()


@few
@given(data=st.data())
def test_any_sequence_of_operations_keeps_the_invariants(data: DataObject) -> None:
    spares = [*crowd(random_robot, 10, 0.7)]
    world = populated(settings_of(drop_m=0.02), [spares.pop() for _ in range(4)])
    for operation in data.draw(
        st.lists(st.sampled_from("bdgs"), min_size=3, max_size=8)
    ):
        alive = world.births
        if operation == "b" and spares:
            world.advance(world.step + 25 - world.step % 25)
            world.apply(Changes(insertions=(spares.pop(),)))
        elif operation == "d" and len(alive) > 1:
            world.apply(Changes(removals=(data.draw(st.sampled_from(alive)),)))
        elif operation == "g":
            world.population.regroup(partition(data, alive))
        else:
            world.advance(world.step + data.draw(st.integers(1, 40)))
        check_population(world.population)
    copy = World.restore(world.population.model_cache.settings, world.snapshot())
    check_population(copy.population)
    assert copy.digest() == world.digest()
    world.close()


def test_arenas_keep_the_invariants_while_robots_meet() -> None:
    for radius_m, drop_m in ((0.4, 0.3), (0.8, 0.0)):
        newborns = crowd(random_robot, 12, radius_m)
        world, regrouped = counted(settings_of(drop_m=drop_m), newborns)
        for _ in range(20):
            world.advance(world.step + 33)
            check_population(world.population)
        assert regrouped.merges
        world.close()


@pytest.mark.parametrize("moments", [1, 3])
@many
@given(data=st.data())
def test_columns_keep_what_is_theirs(moments: int, data: DataObject) -> None:
    """Clusters come and go; the rows of those that stay move with them."""
    columns = StateColumns(moments)
    alive: list[FakeCluster] = []
    for number in range(data.draw(st.integers(1, 8))):
        stay = [each for each in alive if data.draw(st.booleans())]
        widths = data.draw(st.lists(st.integers(1, 5), max_size=3))
        new = [FakeCluster(width) for width in widths]
        alive = [*stay, *new]
        firsts = columns.place(alive)  # type: ignore[arg-type]
        cells = [
            set(range(first, first + each.size))
            for first, each in zip(firsts, alive, strict=True)
        ]
        assert len(set().union(*cells)) == sum(map(len, cells))
        for first, cluster in zip(firsts, alive, strict=True):
            own = columns.states[:, first : first + cluster.size]
            assert np.shares_memory(own, cluster.history.rows)
            assert (own == cluster.mark).all()
            cluster.mark = float(data.draw(st.integers(1, 10**6)) + number)
            cluster.history.rows[:] = cluster.mark


class FakeCluster:
    """Cluster and history of some numbers, all of which are ``mark``."""

    def __init__(self, width: int) -> None:
        self.size, self.mark = width, 0.0
        self.rows = np.zeros((0, width))
        self.history = self

    def move(self, states: np.ndarray, start: int) -> None:
        target = states[:, start : start + self.rows.shape[1]]
        target[:] = 0.0
        target[: len(self.rows)] = self.rows
        self.rows = target


# --- proximity ---------------------------------------------------------------


@few
@given(
    data=st.data(),
    gap_m=st.floats(0.0, 0.4),
    shift=st.tuples(st.floats(-5.0, 5.0), st.floats(-5.0, 5.0)),
)
def test_nearness_is_symmetric_and_grows_with_the_margins(
    data: DataObject, gap_m: float, shift: tuple[float, float]
) -> None:
    """It does not depend on the place of all robots in the plane."""
    world = populated(settings_of(drop_m=0.02), crowd(random_robot, 6, 0.7))
    world.advance(data.draw(st.integers(1, 50)))
    population, count = world.population, len(world.births)
    pairs = list(combinations(range(count), 2))

    def near(pairs: list[tuple[int, int]], gap_m: float) -> list[bool]:
        population.kinematics()
        layout = population.layout
        bounds = RobotBounds(layout, layout.read()[np.newaxis])
        found: list[bool] = bounds.are_near(pairs, np.zeros((1, count)), gap_m)[0]
        return list(found)

    here = near(pairs, gap_m)
    assert near([(second, first) for first, second in pairs], gap_m) == here
    narrow, wide = near(pairs, gap_m - 1e-6), near(pairs, gap_m + 1e-6)
    for robot in population.robots:
        robot.view.qpos[:2] += shift
    for least, found, most in zip(narrow, near(pairs, gap_m), wide, strict=True):
        assert least <= found <= most
    world.close()


@few
@given(margins=st.lists(st.floats(0.0, 0.3), min_size=6, max_size=6))
def test_overlaps_are_symmetric_and_hold_whatever_is_near(margins: list[float]) -> None:
    world = populated(SETTINGS, crowd(random_robot, 6, 0.5))
    layout = world.population.layout
    bounds = RobotBounds(layout, layout.read()[np.newaxis])
    wide = np.array(margins)
    boxes = overlaps(bounds.boxes(wide))
    assert (boxes == boxes.T).all()
    assert boxes.diagonal().all()
    pairs = list(combinations(range(6), 2))
    is_near = bounds.are_near(pairs, wide[np.newaxis], 0.0)[0]
    assert all(boxes[pair] for pair, near in zip(pairs, is_near, strict=True) if near)
    first, second = bounds.neighbours(bounds.boxes(wide))
    assert all(a < b for a, b in zip(first, second, strict=True))
    apart = {
        (a, b)
        for a, b in pairs
        if layout.cluster_indices[a] != layout.cluster_indices[b] and boxes[a, b]
    }
    assert set(zip(first, second, strict=True)) == apart
    world.close()


@few
@given(seed=st.integers(0, 200), gap_m=st.floats(0.001, 0.2))
def test_robots_that_must_merge_must_also_stay(seed: int, gap_m: float) -> None:
    """A cluster that forms is not split at once: its limit is at least as wide."""
    world = populated(settings_of(drop_m=0.1), crowd(random_robot, 6, 0.4, seed=seed))
    proximity = Proximity(settings_of(merge_distance_m=gap_m, split_distance_m=0.0))
    layout = world.population.layout
    bounds = RobotBounds(layout, layout.read()[np.newaxis])
    (pairs,) = proximity.pairs_to_merge(bounds)
    if pairs:
        assert proximity.pairs_to_keep(bounds, pairs) == pairs
    world.close()


# --- intervals ---------------------------------------------------------------


@many
@given(
    proximity=st.integers(1, 40),
    pose=st.integers(1, 60),
    tick=st.integers(1, 40),
    stops=st.lists(st.integers(1, 120), min_size=1, max_size=8),
)
def test_moments_do_not_depend_on_where_advances_end(
    proximity: int, pose: int, tick: int, stops: list[int]
) -> None:
    """Every tick, sample and check is a moment, whatever the intervals are."""
    clock = replace(SETTINGS.simulation, brain_steps=tick, pose_steps=pose)
    arena = settings_of(proximity_steps=proximity)
    schedule = Schedule(replace(arena, simulation=clock))
    step = 0
    found: list[int] = []
    for length in stops:
        until = step + length
        while step < until:
            moments = schedule.moments(step, until)
            assert list(moments) == sorted({*moments})
            assert step < moments[0]
            assert moments[-1] <= until
            assert len(moments) <= schedule.most_moments
            # Nothing that couples clusters happens within an interval.
            assert not any(map(schedule.is_tick, moments[:-1]))
            assert not any(map(schedule.is_split, moments[:-1]))
            found += moments
            step = moments[-1]
    due = {
        moment
        for every in (tick, pose, proximity, MERGES_PER_SPLIT * proximity)
        for moment in range(every, step + 1, every)
    }
    assert due <= set(found)
    assert set(found) - due <= set(np.cumsum(stops).tolist())


@many
@given(
    pieces=st.lists(st.tuples(st.integers(0, 99), st.integers(0, 5)), max_size=6),
    spacing=st.integers(1, 9),
)
def test_runs_are_sequences_one_after_another(
    pieces: list[tuple[int, int]], spacing: int
) -> None:
    starts, counts = np.array(pieces, dtype=np.intp).reshape(-1, 2).T
    expected = [
        start + spacing * place for start, count in pieces for place in range(count)
    ]
    assert runs(starts, counts, spacing).tolist() == expected
