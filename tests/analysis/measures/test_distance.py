"""Tests of tree edit distance: known values, another implementation, a metric."""

import importlib

import numba
import numpy as np
import pytest
import zss
from hypothesis import given, settings
from hypothesis import strategies as st

from analysis.measures.bodies import SlotRule, encode
from schema.errors import InvalidRobot
from schema.robot import body_distance as module
from schema.robot.body_distance import body_distances, tree_distances
from schema.robot.robot import Part, Robot
from tests.analysis.bodies import Body, column, part, random_body

PAIRS = 10_000


def distance(first: Body, second: Body, slots: SlotRule = "parent") -> int:
    trees = encode(column([first, second]), slots)
    a, b = trees.tree_of
    return int(tree_distances(trees, np.array([a]), np.array([b]))[0])


CORE = [part(0, -1, -1, "Core")]
BRICK = [*CORE, part(1, 0, 0, "FixedBrick", own=0)]
HINGE = [*CORE, part(1, 0, 0, "ActiveHinge", own=0)]
CHAIN = [*BRICK, part(2, 1, 2, "Hinge", own=0)]


@pytest.mark.parametrize(
    ("first", "second", "expected"),
    [
        (CORE, CORE, 0),
        (CORE, BRICK, 1),
        (BRICK, HINGE, 1),
        (BRICK, [*CORE, part(1, 0, 3, "FixedBrick")], 1),
        # Another type at another slot: as dear as taking one off and putting one on.
        (BRICK, [*CORE, part(1, 0, 3, "ActiveHinge")], 2),
        (CORE, CHAIN, 2),
        # The brick between core and hinge goes; the hinge moves from slot 2 to 1.
        (CHAIN, [*CORE, part(1, 0, 1, "Hinge")], 2),
        (CHAIN, [*CORE, part(1, 0, 2, "Hinge")], 1),
        # Children are ordered: one of the two is deleted and inserted again.
        (
            [*CORE, part(1, 0, 0, "FixedBrick"), part(2, 0, 1, "ActiveHinge")],
            [*CORE, part(1, 0, 0, "ActiveHinge"), part(2, 0, 1, "FixedBrick")],
            2,
        ),
    ],
)
def test_distances_by_hand(first: Body, second: Body, expected: int) -> None:
    assert distance(first, second) == expected
    assert distance(second, first) == expected


def test_own_slot_rule_compares_the_slot_of_the_part() -> None:
    turned = [*CORE, part(1, 0, 0, "FixedBrick", own=1)]
    moved = [*CORE, part(1, 0, 3, "FixedBrick", own=0)]
    assert [distance(BRICK, turned, rule) for rule in ("parent", "own")] == [0, 1]
    assert [distance(BRICK, moved, rule) for rule in ("parent", "own")] == [1, 0]


def test_distances_of_robots_equal_those_of_rows() -> None:
    rng = np.random.default_rng(3)
    bodies = [random_body(rng, size) for size in (9, 1, 9, 14, 30)]
    robots = [
        Robot(
            tuple(
                Part(row["kind"], row["parent"], row["parent_slot"], 0, 0, ())
                for row in body
            )
        )
        for body in bodies
    ]
    found = body_distances(robots[0], robots).tolist()
    assert found == [distance(bodies[0], body) for body in bodies]
    assert found[0] == 0 < min(found[1:])


def test_equal_trees_are_stored_once() -> None:
    other_numbers = [{**row, "rot": 90, "params": [1.0], "gene": 5} for row in CHAIN]
    trees = encode(column([CHAIN, BRICK, other_numbers]))
    assert trees.tree_of.tolist() == [0, 1, 0]
    # Postorder: hinge, brick, core; each one's leftmost leaf is the hinge.
    assert trees.lefts[:3].tolist() == [0, 0, 0]
    assert trees.slots[:3].tolist() == [2, 0, -1]
    assert trees.key_roots[:3].tolist() == [False, False, True]


class Oracle:
    """Body in the tree type of the older implementation."""

    def __init__(self, body: Body, index: int = 0) -> None:
        self.kind, self.slot = body[index]["kind"], body[index]["parent_slot"]
        rows = [row for row in body if row["parent"] == index]
        rows.sort(key=lambda row: int(row["parent_slot"]))
        self.children = [Oracle(body, row["idx"]) for row in rows]


def relabel(a: Oracle, b: Oracle) -> int:
    is_moved = a.slot != b.slot and a.slot >= 0 and b.slot >= 0
    return int(a.kind != b.kind) + int(is_moved)


def oracle(first: Body, second: Body) -> int:
    found = zss.distance(
        Oracle(first),
        Oracle(second),
        lambda node: node.children,
        lambda _: 1,
        lambda _: 1,
        relabel,
    )
    return int(found)


@pytest.mark.slow
def test_ten_thousand_random_pairs_equal_zss() -> None:
    rng = np.random.default_rng(20261121)
    sizes = np.minimum(1 + rng.poisson(4, 600), 30)
    sizes[:6] = 30
    bodies = [random_body(rng, int(size)) for size in sizes]
    pairs = rng.integers(len(bodies), size=(PAIRS, 2))
    pairs[:3] = [[0, 1], [2, 3], [4, 5]]
    trees = encode(column(bodies))
    mine = tree_distances(trees, trees.tree_of[pairs[:, 0]], trees.tree_of[pairs[:, 1]])
    known: dict[tuple[int, int], int] = {}
    for (a, b), found in zip(pairs.tolist(), mine.tolist(), strict=True):
        if (a, b) not in known:
            known[a, b] = oracle(bodies[a], bodies[b])
        assert found == known[a, b], (bodies[a], bodies[b])


@st.composite
def three_bodies(draw: st.DrawFn) -> list[Body]:
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    return [random_body(rng, draw(st.integers(1, 12))) for _ in range(3)]


def as_labelled(body: Body, slots: SlotRule) -> list[tuple[object, ...]]:
    """Return parent, type and slot of each part: all that the distance depends on."""
    slot = "parent_slot" if slots == "parent" else "child_slot"
    return [(one["parent"], one["kind"], one[slot]) for one in body]


@settings(max_examples=200)
@given(three_bodies(), st.sampled_from(["parent", "own"]))
def test_distance_is_a_metric(bodies: list[Body], slots: SlotRule) -> None:
    trees = encode(column(bodies), slots)
    a, b, c = trees.tree_of
    first, second = np.array([a, b, a, c, a, b]), np.array([b, a, c, a, a, c])
    ab, ba, ac, ca, aa, bc = tree_distances(trees, first, second)
    assert (ab, ac, aa) == (ba, ca, 0)
    one, other = (as_labelled(body, slots) for body in bodies[:2])
    assert (ab == 0) == (one == other)
    assert ac <= ab + bc
    assert ab <= len(bodies[0]) + len(bodies[1]) - 2


@pytest.mark.parametrize(
    "body",
    [
        [],
        [part(0, 0, 0, "Core")],
        [*CORE, part(1, 1, 0, "Hinge")],
        [*CORE, part(1, -1, 0, "Hinge")],
        [*CORE, part(1, 0, 2, "Hinge"), part(2, 0, 1, "Hinge")],
        # A grandchild that stands behind its uncle.
        [*BRICK, part(2, 0, 1, "Hinge"), part(3, 1, 1, "Hinge")],
    ],
)
def test_an_invalid_tree_is_reported_with_its_row(body: Body) -> None:
    with pytest.raises(InvalidRobot, match="body of birth row 1"):
        encode(column([CHAIN, body]))


def test_without_a_folder_for_its_cache_the_distance_is_compiled(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """As in a container whose user can write neither to the package nor at home."""
    monkeypatch.setattr(numba.config, "DISABLE_JIT", 0)

    def no_locator(*_: object) -> None:
        raise RuntimeError("cannot cache function: no locator available")

    monkeypatch.setattr("numba.core.caching.FunctionCache.__init__", no_locator)

    def minus(a: int, b: int) -> int:
        return a - b

    with pytest.raises(RuntimeError, match="no locator"):
        numba.njit(cache=True)(minus)
    assert module._compiled(minus)(7, 4) == 3


def test_distances_do_not_depend_on_the_users_settings_of_numba(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Plain Python, without wrapping numbers, gave another distance here."""
    monkeypatch.setattr(numba.config, "DISABLE_JIT", 1)
    importlib.reload(module)
    assert vars(numba.config)["DISABLE_JIT"] == 1
    assert distance(BRICK, [*CORE, part(1, 0, 3, "ActiveHinge")]) == 2
