"""A robot: a tree of parts and a brain, the phenotype that is built and judged.

Parts stand in a flat tuple in depth-first order (children by ascending slot of
their parent), each naming its parent, so that index 0 is always the core.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

from schema.brain import Brain, Layer, check_brain
from schema.errors import InvalidRobot
from schema.parts import BodySpace, PartType

ORIENTATIONS = (0, 90, 180, 270)
GENES = 2**64
"""How many identities there are."""
NO_BRAIN = Brain()


@dataclass(frozen=True, slots=True)
class Part:
    """One part of a body.

    Attributes:
        kind: name of its part type.
        parent: index of its parent; -1 for the core.
        parent_slot: slot of the parent that it sits on; -1 for the core.
        slot: own slot that it sits with; -1 for the core.
        orientation: turn about its own slot's normal [degrees].
        parameters: values in the order of its type's ``parameters``.
        gene: identity that the part inherits along its line of descent.
    """

    kind: str
    parent: int
    parent_slot: int
    slot: int
    orientation: int
    parameters: tuple[float, ...]
    gene: int = 0


@dataclass(frozen=True, slots=True)
class Robot:
    """A body and the brain that drives it."""

    parts: tuple[Part, ...]
    brain: Brain = NO_BRAIN


def check_tree(parts: Sequence[Part]) -> None:
    """Raise unless parts form a tree, whatever their types are.

    Args:
        parts: the parts of a body.

    Raises:
        InvalidRobot: no part at all; a parent that does not stand before its child;
            a slot below 0 or taken twice; parts out of depth-first order; an
            orientation that is no quarter turn; a number that is not finite; a gene
            that is no 64-bit number.
    """
    if not parts:
        raise InvalidRobot("body: a robot needs at least its core")
    taken: set[tuple[int, int]] = set()
    for index, part in enumerate(parts):
        where = f"body.parts[{index}]"
        _check_place(part, index, where)
        if part.orientation not in ORIENTATIONS:
            raise InvalidRobot(
                f"{where}.orientation: must be one of {ORIENTATIONS}, "
                f"got {part.orientation}"
            )
        if not all(map(math.isfinite, part.parameters)):
            raise InvalidRobot(f"{where}.parameters: must be finite")
        if not 0 <= part.gene < GENES:
            raise InvalidRobot(f"{where}.gene: must be 0..2^64-1, got {part.gene}")
        if index == 0:
            continue
        for end in ((part.parent, part.parent_slot), (index, part.slot)):
            if end in taken:
                raise InvalidRobot(f"{where}: slot {end[1]} of part {end[0]} is taken")
            taken.add(end)
    _check_order(parts)


def _check_place(part: Part, index: int, where: str) -> None:
    if index == 0:
        if (part.parent, part.parent_slot, part.slot) != (-1, -1, -1):
            raise InvalidRobot(
                f"{where}: the core's parent, parent_slot and slot must be -1, "
                f"got {part.parent}, {part.parent_slot}, {part.slot}"
            )
        return
    if not 0 <= part.parent < index:
        raise InvalidRobot(f"{where}.parent: must be 0..{index - 1}, got {part.parent}")
    for name, slot in (("parent_slot", part.parent_slot), ("slot", part.slot)):
        if slot < 0:
            raise InvalidRobot(f"{where}.{name}: must be >= 0, got {slot}")


def check_robot(robot: Robot, space: BodySpace) -> None:
    """Raise unless a robot is well formed in a body space.

    Whether its parts intersect is the analyzer's question, not this one's.

    Args:
        robot: the robot.
        space: the part types that it may use.

    Raises:
        InvalidRobot: no tree of parts (``check_tree``), no core or more than one, an
            unknown part type, a slot that a type does not have, a wrong number of
            parameters or one out of its range, a brain that breaks its rules or
            does not fit the sensors and motors of the body.
    """
    check_tree(robot.parts)
    for index, part in enumerate(robot.parts):
        _check_part(part, index, space)
        if index == 0:
            continue
        parent = robot.parts[part.parent]
        for name, owner, slot in (
            ("parent_slot", parent, part.parent_slot),
            ("slot", part, part.slot),
        ):
            arity = space[owner.kind].arity
            if slot >= arity:
                raise InvalidRobot(
                    f"body.parts[{index}].{name}: {owner.kind} has slots "
                    f"0..{arity - 1}, got {slot}"
                )
    check_brain(robot.brain, len(robot.parts))
    _check_wiring(robot, space)


def _check_part(part: Part, index: int, space: BodySpace) -> None:
    where = f"body.parts[{index}]"
    kind = part_type(part.kind, space, where)
    if kind.is_root != (index == 0):
        raise InvalidRobot(
            f"{where}: exactly the first part must be a core, got {part.kind}"
        )
    if len(part.parameters) != len(kind.parameters):
        raise InvalidRobot(
            f"{where}.parameters: {part.kind} takes {len(kind.parameters)}, "
            f"got {len(part.parameters)}"
        )
    for parameter, value in zip(kind.parameters, part.parameters, strict=True):
        if not parameter.low <= value <= parameter.high:
            raise InvalidRobot(
                f"{where}.{parameter.name}: must be in "
                f"[{parameter.low}, {parameter.high}], got {value}"
            )


def part_type(name: str, space: BodySpace, where: str) -> PartType:
    """Return the part type of a name.

    Raises:
        InvalidRobot: the body space has none of that name.
    """
    if name not in space:
        raise InvalidRobot(
            f"{where}.kind: must be one of {', '.join(space)}, got {name!r}"
        )
    return space[name]


def _check_order(parts: Sequence[Part]) -> None:
    """Raise unless parts stand depth first, children by ascending slot."""
    path: list[int] = []
    last_slot: dict[int, int] = {}
    for index, part in enumerate(parts):
        while path and path[-1] != part.parent:
            path.pop()
        is_first = index == 0
        if not is_first and (
            not path or last_slot.get(part.parent, -1) >= part.parent_slot
        ):
            raise InvalidRobot(
                f"body.parts[{index}]: parts must stand depth first, "
                "children by ascending slot"
            )
        last_slot[part.parent] = part.parent_slot
        path.append(index)


def _check_wiring(robot: Robot, space: BodySpace) -> None:
    """Raise unless inputs and outputs are those of the sensors and motors."""
    kinds = [space[part.kind] for part in robot.parts]
    _check_owners(robot, "input", [kind.inputs for kind in kinds])
    _check_owners(robot, "output", [kind.outputs for kind in kinds])


def _check_owners(robot: Robot, layer: Layer, counts: Sequence[int]) -> None:
    expected = [index for index, count in enumerate(counts) for _ in range(count)]
    owners = [n.part for n in robot.brain.neurons if n.layer == layer]
    if owners != expected:
        raise InvalidRobot(
            f"brain: {layer} neurons must belong to parts {expected}, got {owners}"
        )
