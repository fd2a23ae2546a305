"""Bodies of a births table as trees."""

from typing import Literal

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc

from schema.robot.trees import Trees, trees_of

SlotRule = Literal["parent", "own"]
"""Slot that labels a part: its parent's (thesis) or its own (published code)."""


def encode(bodies: pa.ChunkedArray, slots: SlotRule = "parent") -> Trees:
    """Return bodies as trees.

    Args:
        bodies: (B,) lists of parts, as column ``body`` of the births table.
        slots: slot that labels a part.

    Raises:
        InvalidRobot: a body is not a tree in depth-first order with children by
            ascending slot.
    """
    lists = bodies.combine_chunks()
    parts = lists.flatten()
    sizes = np.asarray(pc.list_value_length(lists), np.int64)
    own = np.asarray(parts.field("child_slot"), np.int64)
    places = np.asarray(parts.field("parent_slot"), np.int64)
    parents = np.asarray(parts.field("parent"), np.int64)
    kinds = parts.field("kind").dictionary_encode().indices
    label = np.where(parents < 0, -1, places if slots == "parent" else own)
    columns = np.stack([parents, np.asarray(kinds, np.int64), label, places], axis=1)
    return trees_of(columns, sizes)
