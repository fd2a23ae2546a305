"""Division of robots into parts: by hand, and properties of random ones."""

from itertools import combinations
from random import Random

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from coordinator.parts.partition import divide, groups_of
from schema.robot.groups import Group
from schema.robot.ids import BirthId
from schema.wire.arena import Box

A, B, C, D = (BirthId(0, number) for number in range(4))
places = st.floats(-3.0, 3.0, width=16)
boxes = st.dictionaries(
    st.builds(BirthId, st.integers(0, 1), st.integers(0, 20)),
    st.tuples(places, places, st.floats(0.0, 1.0), st.floats(0.0, 1.0)).map(
        lambda box: (box[0], box[1], box[0] + box[2], box[1] + box[3])
    ),
    max_size=12,
)


def do_overlap(first: Box, second: Box) -> bool:
    """Return whether two boxes have a point in common, as one would by hand."""
    return all(
        max(first[side], second[side]) <= min(first[side + 2], second[side + 2])
        for side in (0, 1)
    )


def test_robots_in_a_row_are_one_group_without_their_neighbour_apart() -> None:
    row = {A: (0.0, 0.0, 1.0, 1.0), B: (0.9, 0.5, 2.0, 2.0), C: (2.0, 2.0, 3.0, 3.0)}
    apart = row | {D: (3.08, 0.0, 4.0, 4.0)}
    assert groups_of(apart, []) == [(A, B, C), (D,)]
    assert groups_of(apart, [], growth_m=0.05) == [(A, B, C, D)]
    assert groups_of(apart, [(A, D)]) == [(A, B, C, D)]


@settings(max_examples=100, deadline=None)
@given(boxes=boxes)
def test_robots_of_different_groups_never_overlap(boxes: dict[BirthId, Box]) -> None:
    groups = groups_of(boxes, [])
    assert sorted(birth for group in groups for birth in group) == sorted(boxes)
    for first, second in combinations(groups, 2):
        assert not any(do_overlap(boxes[a], boxes[b]) for a in first for b in second)
    for group in groups:
        # None could be divided further.
        inside = [
            (a, b) for a, b in combinations(group, 2) if do_overlap(boxes[a], boxes[b])
        ]
        reached = {group[0]}
        for _ in group:
            for pair in inside:
                if reached & {*pair}:
                    reached |= {*pair}
        assert reached == {*group}


@pytest.mark.parametrize(
    ("costs", "held", "divided"),
    [
        # Nobody has them: the most expensive first, to the part with the least.
        ((4.0, 3.0, 2.0, 2.0), {}, [[(A,), (D,)], [(B,), (C,)]]),
        # Balanced as they are, although one could do without moves of equal groups.
        ((4.0, 4.0, 1.0, 1.0), {A: 1, B: 0, C: 1, D: 0}, [[(B,), (D,)], [(A,), (C,)]]),
        # All at one part: half of them move.
        ((1.0,) * 4, dict.fromkeys((A, B, C, D), 1), [[(A,), (B,)], [(C,), (D,)]]),
        # The gain of 0.5 of a move of 4 does not pay.
        ((4.0, 4.0, 3.4, 0.1), {A: 0, B: 0, C: 1, D: 1}, [[(A,), (B,)], [(C,), (D,)]]),
    ],
)
def test_groups_stay_where_they_are_unless_a_move_pays(
    costs: tuple[float, ...], held: dict[BirthId, int], divided: list[list[Group]]
) -> None:
    groups = [(A,), (B,), (C,), (D,)]
    assert divide(groups, dict(zip((A, B, C, D), costs, strict=True)), held, 2) == (
        divided
    )


@settings(max_examples=100, deadline=None)
@given(
    sizes=st.lists(st.tuples(st.integers(1, 4), st.floats(0.1, 9.0)), max_size=15),
    parts=st.integers(1, 4),
    seed=st.randoms(use_true_random=False),
)
def test_no_move_pays_in_what_is_divided(
    sizes: list[tuple[int, float]], parts: int, seed: Random
) -> None:
    groups, costs = list[Group](), dict[BirthId, float]()
    for size, cost in sizes:
        members = tuple(BirthId(0, len(costs) + number) for number in range(size))
        groups.append(members)
        costs |= dict.fromkeys(members, cost)
    held = {birth: seed.randrange(2 * parts) for birth in costs}
    divided = divide(groups, costs, held, parts)
    assert sorted(group for part in divided for group in part) == sorted(groups)
    loads = [sum(costs[b] for group in part for b in group) for part in divided]
    again = {b: n for n, part in enumerate(divided) for group in part for b in group}
    assert divide(groups, costs, again, parts) == divided
    if max(loads) - min(loads) <= 0.02 * max(loads):
        return
    for group in divided[loads.index(max(loads))]:
        cost = sum(costs[birth] for birth in group)
        after = max(max(loads) - cost, min(loads) + cost)
        assert max(loads) - after <= 0.3 * cost + 1e-9


def test_many_small_groups_are_balanced_though_each_alone_gains_little() -> None:
    groups = [(BirthId(0, number),) for number in range(500)]
    costs = {birth: 1.0 for (birth,) in groups}
    held = {birth: int(birth.number >= 400) for birth in costs}
    loads = [len(part) for part in divide(groups, costs, held, 2)]
    assert sum(loads) == 500
    assert max(loads) <= 255
