"""Builders of bodies for the tests of the analysis."""

from typing import Any

import numpy as np
import pyarrow as pa

from schema.tables.columns import BIRTHS

Body = list[dict[str, Any]]
KINDS = ("FixedBrick", "ActiveHinge", "Hinge", "ParametricBarJoint", "TouchSensor")


def part(  # noqa: PLR0917 - a row of a table, written down
    idx: int, parent: int, place: int, kind: str, own: int = 0, gene: int = 0
) -> dict[str, Any]:
    """Return one part of a body."""
    core = parent < 0
    return {
        "idx": idx,
        "parent": parent,
        "parent_slot": -1 if core else place,
        "child_slot": -1 if core else own,
        "kind": kind,
        "rot": 0,
        "params": [],
        "gene": gene,
    }


def random_body(rng: np.random.Generator, parts: int) -> Body:
    """Return a body of so many parts, each put where there is a free slot."""
    children: list[list[tuple[int, int]]] = [[]]
    free = [(0, slot) for slot in range(4)]
    for index in range(1, parts):
        parent, slot = free.pop(int(rng.integers(len(free))))
        children[parent].append((slot, index))
        children.append([])
        free += [(index, slot) for slot in (1, 2, 3)]
    body: Body = []

    def walk(node: int, parent: int, slot: int) -> None:
        index = len(body)
        kind = "Core" if parent < 0 else KINDS[int(rng.integers(len(KINDS)))]
        body.append(part(index, parent, slot, kind, own=int(rng.integers(2))))
        for child_slot, child in sorted(children[node]):
            walk(child, index, child_slot)

    walk(0, -1, -1)
    return body


def column(bodies: list[Body]) -> pa.ChunkedArray:
    """Return bodies as column ``body`` of a births table."""
    return pa.chunked_array([pa.array(bodies, BIRTHS.field("body").type)])
