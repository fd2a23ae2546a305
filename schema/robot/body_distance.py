"""Distance of two bodies: tree edit distance, compiled by Numba.

Inserting or deleting a part costs 1. Replacing a part costs 1 if the types differ and 1
if the slots differ, the latter only if both parts have a parent. This is a metric,
because only cores have no parent and no other part is a core.

The functions are compiled at the first call and cached on disk.
"""

from collections.abc import Sequence
from typing import Any

import numba
import numpy as np

from schema.robot.robot import Robot
from schema.robot.trees import Integers, Trees, trees_of


def body_distances(robot: Robot, others: Sequence[Robot]) -> Integers:
    """Return the edit distances, (N,), of a robot's body to those of others, (N,).

    A part's label is its parent's slot; parameters and brains are ignored.
    """
    bodies = [robot.parts, *(other.parts for other in others)]
    every = [part for body in bodies for part in body]
    numbers = {name: at for at, name in enumerate({part.kind for part in every})}
    columns = [
        (one.parent, numbers[one.kind], one.parent_slot, one.parent_slot)
        for one in every
    ]
    sizes = np.array([len(body) for body in bodies], np.int64)
    trees = trees_of(np.array(columns, np.int64), sizes)
    first, *rest = trees.tree_of
    return tree_distances(trees, np.full(len(rest), first), np.array(rest, np.int64))


def tree_distances(trees: Trees, first: Integers, second: Integers) -> Integers:
    """Return the edit distances, (P,), of pairs of trees by their indices, (P,).

    It is the least total cost of edits that turn one tree into the other.

    Source: Zhang and Shasha, *Simple fast algorithms for the editing distance
    between trees and related problems*, SIAM J. Comput. 18(6), 1989; costs: Hupkes
    2016, section 6.2.1.
    """
    # Small integers, so that the arrays of a pair stay in the L1 cache.
    kinds, slots, lefts = (
        np.ascontiguousarray(column, np.int32)
        for column in (trees.kinds, trees.slots, trees.lefts)
    )
    pairs = np.ascontiguousarray(np.stack([first, second], axis=1), np.int64)
    nodes = (kinds, slots, lefts, trees.key_roots)
    distances: Integers = _distances(trees.starts, nodes, pairs)
    return distances


def _compiled(function: Any) -> Any:  # noqa: ANN401 - of Numba, which has no types
    # With NUMBA_DISABLE_JIT Python would compute, and its numbers do not wrap around.
    config: Any = numba.config
    is_off, config.DISABLE_JIT = config.DISABLE_JIT, 0
    try:
        return numba.njit(cache=True, nogil=True)(function)
    except RuntimeError:  # No folder for the cache can be written.
        return numba.njit(nogil=True)(function)
    finally:
        config.DISABLE_JIT = is_off


@_compiled
def _distances(starts, nodes, pairs):  # type: ignore[no-untyped-def] # noqa: ANN001, ANN202
    kinds, slots, lefts, key_roots = nodes
    largest = 0
    for tree in range(len(starts) - 1):
        largest = max(largest, starts[tree + 1] - starts[tree])
    costs = np.zeros((largest, largest), np.int32)
    subtrees = np.zeros((largest, largest), np.int32)
    forests = np.zeros((largest + 1, largest + 1), np.int32)
    found = np.zeros(len(pairs), np.int64)
    for pair in range(len(pairs)):
        first, second = pairs[pair]
        if first == second:
            continue
        a, a_end = starts[first], starts[first + 1]
        b, b_end = starts[second], starts[second + 1]
        for i in range(a, a_end):
            for j in range(b, b_end):
                has_moved = slots[i] != slots[j] and slots[i] >= 0 and slots[j] >= 0
                costs[i - a, j - b] = (kinds[i] != kinds[j]) + has_moved
        a_lefts, b_lefts = lefts[a:a_end], lefts[b:b_end]
        for i in range(a_end - a):
            for j in range(b_end - b):
                if key_roots[a + i] and key_roots[b + j]:
                    _fill(costs, (a_lefts, i), (b_lefts, j), subtrees, forests)
        found[pair] = subtrees[a_end - a - 1, b_end - b - 1]
    return found


@_compiled
def _fill(costs, a, b, subtrees, forests):  # type: ignore[no-untyped-def] # noqa: ANN001, ANN202
    """Compute the distances of the subtrees that end with two key roots.

    Unsigned indices save the loop a check for negative indices.
    """
    (a_lefts, i), (b_lefts, j) = a, b
    one = np.uint32(1)
    i_left, j_left = np.uint32(a_lefts[i]), np.uint32(b_lefts[j])
    rows, columns = np.uint32(i) - i_left + one, np.uint32(j) - j_left + one
    for y in range(columns + one):
        forests[0, y] = y
    for x in range(one, rows + one):
        node = i_left + x - one
        left = np.uint32(a_lefts[node]) - i_left
        row, above, joined = forests[x], forests[x - one], forests[left]
        beside = np.int32(x)
        row[0] = beside
        for y in range(one, columns + one):
            other = j_left + y - one
            other_left = np.uint32(b_lefts[other]) - j_left
            least = min(above[y], beside) + np.int32(1)
            if left == 0 and other_left == 0:
                least = min(least, above[y - one] + costs[node, other])
                subtrees[node, other] = least
            else:
                least = min(least, joined[other_left] + subtrees[node, other])
            beside = np.int32(least)
            row[y] = beside
