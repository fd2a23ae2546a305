"""Bodies as ordered, labelled trees, in arrays for compiled loops.

Every tree is stored in postorder: children by ascending slot of their parent, then
their parent. Equal trees are stored once.
"""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from schema.errors import InvalidRobot

Integers = npt.NDArray[np.int64]


@dataclass(frozen=True, slots=True)
class Trees:
    """The U different trees of B bodies, with M parts in total.

    Attributes:
        tree_of: (B,) index of each body's tree.
        starts: (U + 1,) index of each tree's first part.
        kinds: (M,) number of each part's type.
        slots: (M,) slot that labels the part; -1 for the core.
        lefts: (M,) leftmost leaf below the part, as postorder number in the tree.
        key_roots: (M,) whether the part is the core or has a sibling before it.
    """

    tree_of: Integers
    starts: Integers
    kinds: Integers
    slots: Integers
    lefts: Integers
    key_roots: npt.NDArray[np.bool_]


def trees_of(columns: Integers, sizes: Integers) -> Trees:
    """Return bodies as trees, of the sizes (B,) [parts].

    Columns (N, 4) are the parts of B bodies in depth-first order: index of the parent
    in its body, -1 for the core; number of the type; slot that labels the part, -1 for
    the core; slot of the parent.

    Raises:
        InvalidRobot: another order, or children not by ascending slot.
    """
    starts = np.concatenate([[0], np.cumsum(sizes)])
    tree_of, firsts = _different(columns, starts)
    is_chosen = np.isin(np.repeat(np.arange(len(sizes)), sizes), firsts)
    return _postorder(tree_of, columns[is_chosen], sizes[firsts], firsts)


def _different(columns: Integers, starts: Integers) -> tuple[Integers, Integers]:
    """Return the tree of each body, and the first body of each tree."""
    known: dict[bytes, int] = {}
    firsts: list[int] = []
    tree_of = np.empty(len(starts) - 1, np.int64)
    for body in range(len(tree_of)):
        key = columns[starts[body] : starts[body + 1]].tobytes()
        number = known.setdefault(key, len(firsts))
        if number == len(firsts):
            firsts.append(body)
        tree_of[body] = number
    return tree_of, np.array(firsts, np.int64)


def _postorder(
    tree_of: Integers, columns: Integers, lengths: Integers, bodies: Integers
) -> Trees:
    """Return depth-first parts (parent, kind, label, place) in postorder."""
    starts = np.concatenate([[0], np.cumsum(lengths)])
    tree = np.repeat(np.arange(len(lengths)), lengths)
    at = np.arange(len(tree))
    index = at - starts[tree]
    parents, kinds, labels, places = columns.T
    is_core = index == 0
    _check(
        bodies[tree],
        np.where(is_core, parents != -1, (parents < 0) | (parents >= index)),
        "a part's parent must come before it, and only the core has none",
    )
    _check(bodies, lengths == 0, "has no parts")
    above = np.where(is_core, at, parents + starts[tree])
    depth, size = _depth_and_size(above, is_core)
    previous = np.full(len(at), -1, np.int64)
    order = np.lexsort((at, above))
    order = order[~is_core[order]]
    same = above[order][1:] == above[order][:-1]
    previous[order[1:][same]] = places[order[:-1][same]]
    _check(
        bodies[tree],
        (~is_core) & ((at + size > above + size[above]) | (places <= previous)),
        "parts must be in depth-first order, children by ascending slot",
    )
    leaf = np.where(size == 1, at, len(at))
    leftmost = np.minimum.accumulate(leaf[::-1])[::-1]
    slot = index - depth + size - 1
    target = starts[tree] + slot
    ordered = np.empty((4, len(at)), np.int64)
    is_key = is_core | (above != at - 1)
    ordered[:, target] = np.stack([kinds, labels, slot[leftmost], is_key])
    return Trees(
        tree_of, starts, ordered[0], ordered[1], ordered[2], ordered[3].astype(bool)
    )


def _depth_and_size(
    above: Integers, is_core: npt.NDArray[np.bool_]
) -> tuple[Integers, Integers]:
    """Return each part's depth and the size of its subtree, itself included."""
    parents, others = above.tolist(), np.flatnonzero(~is_core).tolist()
    depth, size = [0] * len(parents), [1] * len(parents)
    for part in others:  # parents come before their children
        depth[part] = depth[parents[part]] + 1
    for part in reversed(others):
        size[parents[part]] += size[part]
    return np.array(depth, np.int64), np.array(size, np.int64)


def _check(body: Integers, is_wrong: npt.NDArray[np.bool_], rule: str) -> None:
    if is_wrong.any():
        raise InvalidRobot(f"body of birth row {body[is_wrong][0]}: {rule}")
