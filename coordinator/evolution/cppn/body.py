"""Development of a body: a tree of parts that grows where a network says so.

From the core outwards, level by level, the network is queried for each free slot, with
the centre of the part and the place of the slot. It must be the surer of a part the
farther away the slot is. Part types that would exceed a limit
do not take part in the choice; a part that would intersect another one does not grow.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import lru_cache

import numpy as np

from coordinator.evolution.cppn.network import CppnGenome, evaluate, queries
from schema.experiment.document import Space
from schema.parts import BodySpace, Parameter, PartType, Shape
from schema.robot.frames import attach
from schema.robot.robot import ORIENTATIONS, Part
from schema.robot.trace import Floats

UNIT_M = 0.1
"""Unit of positions in queries [m]."""
_TOUCHING_M = 1e-4
"""Boxes that overlap by less do not intersect [m]."""

_NEAR, _FALL = 0.5, 0.3
"""A part grows where the output ``part`` is above 0 and this line over distance."""

PART, TURN, SLOT = "part", "turn", "slot"

Values = Mapping[str, float]
"""Outputs of one query."""


def body_outputs(types: BodySpace) -> tuple[str, ...]:
    """Return the names of the outputs that describe a body."""
    parameters = {p.name: None for kind in types.values() for p in kind.parameters}
    kinds = [f"type {kind.name}" for kind in types.values() if not kind.is_root]
    return (PART, TURN, SLOT, *kinds, *(f"part {name}" for name in parameters))


@dataclass(slots=True, eq=False)
class Grown:
    """Part of a growing body.

    Attributes:
        shape: for these parameters.
        slot: own slot by which it is attached; -1 for the core.
        orientation: about the normal of that slot [degrees].
        turn: sum of all orientations from the core on [degrees].
        rotation: (3, 3), part frame to core frame.
        position: (3,), core frame [m].
        boxes: (B, 2, 3), least and greatest corners of its boxes, core frame [m].
        children: by slot.
    """

    kind: PartType
    parameters: tuple[float, ...]
    shape: Shape
    slot: int
    orientation: int
    turn: int
    rotation: Floats
    position: Floats
    boxes: Floats
    children: "dict[int, Grown]" = field(default_factory=dict)


def grow(network: CppnGenome, space: Space, types: BodySpace) -> list[Grown]:
    """Return the parts of a body in the order of their growth, the core first."""
    names = body_outputs(types)
    core = next(kind for kind in types.values() if kind.is_root)
    origin = np.zeros((1, 4))
    values = _rows(evaluate(network, queries(origin, origin), names))[0]
    parts = [_core(core, values)]
    level = parts
    while level and len(parts) < space.max_parts:
        places = [
            (parent, slot)
            for parent in level
            for slot in range(parent.kind.arity)
            if slot != parent.slot
        ]
        level = []
        if not places:
            break
        asked = _queries(places)
        least = np.maximum(_FALL * (asked["distance"] - _NEAR), 0.0).tolist()
        found = _rows(evaluate(network, asked, names))
        for (parent, slot), values, limit in zip(places, found, least, strict=True):
            if values[PART] <= limit:
                continue
            grown = _child(parent, slot, values, _usable(types, parts, space), space)
            if grown is not None and not _is_blocked(grown, parent, parts):
                parent.children[slot] = grown
                level.append(grown)
                parts.append(grown)
    return parts


def parts_of(core: Grown) -> tuple[list[Part], list[Grown]]:
    """Return the parts of a body depth first, as records and as they have grown."""
    parts: list[Part] = []
    order: list[Grown] = []
    stack = [(core, -1, -1)]
    while stack:
        grown, parent, parent_slot = stack.pop()
        index = len(parts)
        order.append(grown)
        parts.append(
            Part(
                grown.kind.name,
                parent,
                parent_slot,
                grown.slot,
                grown.orientation,
                grown.parameters,
            )
        )
        stack += [
            (child, index, slot)
            for slot, child in sorted(grown.children.items(), reverse=True)
        ]
    return parts, order


def point(position: Floats) -> list[float]:
    """Return a position [m] as coordinates of a query.

    It is rounded: the last bits of a sum may differ between machines.
    """
    return [round(float(each) / UNIT_M, 6) + 0.0 for each in position]


def share(value: float) -> float:
    """Return an output, in (-1, 1), as a share in [0, 1)."""
    return min(max(0.5 * (value + 1.0), 0.0), 1.0 - 2.0**-53)


def parameters_from(
    values: Values, parameters: Sequence[Parameter], prefix: str
) -> tuple[float, ...]:
    """Return a value in its range for each parameter, from the outputs of a query."""
    found = []
    for each in parameters:
        value = each.low + (each.high - each.low) * share(values[prefix + each.name])
        found.append(min(max(value, each.low), each.high))
    return tuple(found)


def _rows(columns: Mapping[str, Floats]) -> list[Values]:
    lists = [column.tolist() for column in columns.values()]
    return [dict(zip(columns, row, strict=True)) for row in zip(*lists, strict=True)]


def _queries(places: Sequence[tuple[Grown, int]]) -> dict[str, Floats]:
    first, second = [], []
    for parent, slot in places:
        at = parent.shape.slots[slot].position
        first.append([*point(parent.position), 0.0])
        second.append([*point(parent.position + parent.rotation @ at), 0.0])
    return queries(np.array(first), np.array(second))


def _core(kind: PartType, values: Values) -> Grown:
    parameters = parameters_from(values, kind.parameters, "part ")
    shape = kind.shape(parameters)
    rotation, position = np.eye(3), np.zeros(3)
    boxes = _boxes(shape, rotation, position)
    return Grown(kind, parameters, shape, -1, 0, 0, rotation, position, boxes)


def _usable(types: BodySpace, parts: Sequence[Grown], space: Space) -> list[PartType]:
    """Return the types of which one more part stays within all limits."""
    if len(parts) >= space.max_parts:
        return []
    inputs = sum(part.kind.inputs for part in parts)
    outputs = sum(part.kind.outputs for part in parts)
    return [
        kind
        for kind in types.values()
        if not kind.is_root
        and inputs + kind.inputs <= space.max_inputs
        and outputs + kind.outputs <= space.max_outputs
    ]


def _child(
    parent: Grown, place: int, values: Values, usable: Sequence[PartType], space: Space
) -> Grown | None:
    """Return the part that grows on a slot; None if none does."""
    fitting = [kind for kind in usable if parent.kind.name not in kind.not_on]
    if not fitting:
        return None
    # Of equal values the first type wins.
    kind = max(fitting, key=lambda kind: values[f"type {kind.name}"])
    parameters = parameters_from(values, kind.parameters, "part ")
    shape = kind.shape(parameters)
    slot = int(share(values[SLOT]) * kind.arity)
    orientation = ORIENTATIONS[int(share(values[TURN]) * len(ORIENTATIONS))]
    if space.planar and kind.is_levelled:
        orientation = (360 - parent.turn) % 360
    turned, offset = attach(parent.shape.slots[place], shape.slots[slot], orientation)
    rotation = parent.rotation @ turned
    position = parent.position + parent.rotation @ offset
    return Grown(
        kind,
        parameters,
        shape,
        slot,
        orientation,
        (parent.turn + orientation) % 360,
        rotation,
        position,
        _boxes(shape, rotation, position),
    )


def _boxes(shape: Shape, rotation: Floats, position: Floats) -> Floats:
    """Return the boxes, parallel to the core's axes, around those of a part."""
    centres, halves = _local_boxes(shape)
    middle = position + centres @ rotation.T
    reach = np.einsum("ij,bjk->bik", np.abs(rotation), halves).sum(axis=2)
    return np.stack((middle - reach, middle + reach), axis=1)


@lru_cache(maxsize=4096)
def _local_boxes(shape: Shape) -> tuple[Floats, Floats]:
    """Return centres (B, 3) and half axes (B, 3, 3), as absolute values [m]."""
    centres = np.array([box.position for box in shape.boxes])
    axes = np.abs(np.array([box.rotation for box in shape.boxes]))
    sizes = np.array([box.size for box in shape.boxes])
    return centres, axes * (0.5 * sizes[:, None, :])


def _is_blocked(grown: Grown, parent: Grown, parts: Sequence[Grown]) -> bool:
    others = [part.boxes for part in parts if part is not parent]
    if not others:
        return False
    low, high = np.concatenate(others).transpose(1, 0, 2)
    for least, greatest in grown.boxes:
        depth = np.minimum(high, greatest) - np.maximum(low, least)
        if (depth > _TOUCHING_M).all(axis=1).any():
            return True
    return False
