"""Sizes of robots, and their bodies as trees."""

from typing import Literal

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc

from analysis.measures.outputs import BODY, PER_PART
from analysis.measures.population_table import Numbers
from schema.robot.trees import Trees, trees_of

TOUCH = "TouchSensor"
"""Part type of touch sensors."""
SlotRule = Literal["parent", "own"]
"""Slot that labels a part: its parent's (thesis) or its own (published code)."""


def body_sizes(births: pa.Table) -> dict[str, Numbers]:
    """Return the sizes of every individual, (B,) by ``outputs.BODY`` and ``PER_PART``.

    Joints with a motor are active, all others passive.

    Source: Hupkes 2016, figures 6.9 to 6.16. Touch sensors are counted as parts; the
    axis of figure 6.15 seems to count their inputs, two per sensor.
    """
    found = {
        name: np.asarray(births[name], np.float64)
        for name in ("parts", "joints", "extremities", "hidden", "connections")
    }
    found["active_joints"] = np.asarray(births["motors"], np.float64)
    found["passive_joints"] = found["joints"] - found["active_joints"]
    lists = births["body"].combine_chunks()
    owners = np.asarray(pc.list_parent_indices(lists), np.int64)
    is_touch = np.asarray(pc.equal(lists.flatten().field("kind"), TOUCH), np.bool_)
    count = np.bincount(owners[is_touch], minlength=births.num_rows)
    found["touch_sensors"] = count.astype(np.float64)
    for name in PER_PART:
        found[name] = found[name.removesuffix("_per_part")] / found["parts"]
    return {name: found[name] for name in (*BODY, *PER_PART)}


def extremity_bins(robots: pa.Table) -> pa.Table:
    """Return the mean fitness of robots, rows of ``robots``, by their extremities.

    Source: Hupkes 2016, figure 6.14.
    """
    count = np.asarray(robots["extremities"], np.int64)
    # Integers, so that 3 of 10 is in the bin that starts at 0.3.
    tenths = count * 10 // np.maximum(np.asarray(robots["parts"], np.int64), 1)
    born = pa.table(
        {
            "is_last": robots["is_last"],
            "fitness": robots["fitness"],
            "count": count.astype(np.float64),
            "per_part": tenths / 10,
        }
    )
    pieces = []
    for population, rows in (("final", born.filter(born["is_last"])), ("born", born)):
        for by in ("count", "per_part"):
            groups = rows.group_by(by)
            totals = groups.aggregate([("fitness", "count"), ("fitness", "mean")])
            binned = totals.rename_columns(["bin", "robots", "fitness"]).sort_by("bin")
            for name, value in (("by", by), ("population", population)):
                repeated = pa.repeat(pa.scalar(value), binned.num_rows)
                binned = binned.add_column(0, name, repeated)
            pieces.append(binned)
    return pa.concat_tables(pieces)


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
