"""A robot: a tree of parts and a brain, the phenotype that is built and judged.

Parts stand in a flat tuple in depth-first order (children by ascending slot of
their parent), each naming its parent, so that index 0 is always the core.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

from msgspec import Struct

from schema.errors import InvalidRobot
from schema.parts import BodySpace, PartType
from schema.robot.brain import Brain, Layer, check_brain

ORIENTATIONS = (0, 90, 180, 270)
GENES = 2**64
"""How many identities there are."""
NO_BRAIN = Brain()


class Part(Struct, frozen=True, gc=False):
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
        # Texts only where they are needed: this runs in every process, every birth.
        if problem := _place_problem(part, index) or _value_problem(part):
            raise InvalidRobot(f"body.parts[{index}]{problem}")
        if index == 0:
            continue
        for end in ((part.parent, part.parent_slot), (index, part.slot)):
            if end in taken:
                raise InvalidRobot(
                    f"body.parts[{index}]: slot {end[1]} of part {end[0]} is taken"
                )
            taken.add(end)
    _check_order(parts)


def _place_problem(part: Part, index: int) -> str:
    """Return what is wrong with where a part sits; nothing if it may sit there."""
    if index == 0:
        if (part.parent, part.parent_slot, part.slot) == (-1, -1, -1):
            return ""
        return (
            ": the core's parent, parent_slot and slot must be -1, "
            f"got {part.parent}, {part.parent_slot}, {part.slot}"
        )
    if not 0 <= part.parent < index:
        return f".parent: must be 0..{index - 1}, got {part.parent}"
    if part.parent_slot < 0:
        return f".parent_slot: must be >= 0, got {part.parent_slot}"
    return f".slot: must be >= 0, got {part.slot}" if part.slot < 0 else ""


def _value_problem(part: Part) -> str:
    """Return what is wrong with a part's numbers whatever its type is."""
    if part.orientation not in ORIENTATIONS:
        return f".orientation: must be one of {ORIENTATIONS}, got {part.orientation}"
    if not all(map(math.isfinite, part.parameters)):
        return ".parameters: must be finite"
    if not 0 <= part.gene < GENES:
        return f".gene: must be 0..2^64-1, got {part.gene}"
    return ""


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
    check_brain(robot.brain, len(robot.parts))
    check_types(robot, space)


def check_types(robot: Robot, space: BodySpace) -> None:
    """Raise unless a robot keeps the rules of a body space.

    Args:
        robot: a tree of parts and a sound brain, as every decoded robot is.
        space: the part types that it may use.

    Raises:
        InvalidRobot: as ``check_robot``, as far as part types decide about it.
    """
    check_body(robot.parts, space)
    _check_wiring(robot, space)


def check_body(parts: Sequence[Part], space: BodySpace) -> None:
    """Raise unless a body keeps the rules of a body space, whatever drives it.

    Args:
        parts: a tree of parts, as every decoded body is.
        space: the part types that it may use.

    Raises:
        InvalidRobot: as ``check_types``, but for the brain.
    """
    for index, part in enumerate(parts):
        _check_part(part, index, space)
        if index == 0:
            continue
        parent = parts[part.parent]
        if part.parent_slot >= space[parent.kind].arity:
            raise _no_slot(index, "parent_slot", parent, part.parent_slot, space)
        if part.slot >= space[part.kind].arity:
            raise _no_slot(index, "slot", part, part.slot, space)


def _no_slot(
    index: int, name: str, owner: Part, slot: int, space: BodySpace
) -> InvalidRobot:
    return InvalidRobot(
        f"body.parts[{index}].{name}: {owner.kind} has slots "
        f"0..{space[owner.kind].arity - 1}, got {slot}"
    )


def _check_part(part: Part, index: int, space: BodySpace) -> None:
    kind = space.get(part.kind) or part_type(part.kind, space, f"body.parts[{index}]")
    if kind.is_root != (index == 0):
        raise InvalidRobot(
            f"body.parts[{index}]: exactly the first part must be a core, "
            f"got {part.kind}"
        )
    if len(part.parameters) != len(kind.parameters):
        raise InvalidRobot(
            f"body.parts[{index}].parameters: {part.kind} takes "
            f"{len(kind.parameters)}, got {len(part.parameters)}"
        )
    for parameter, value in zip(kind.parameters, part.parameters, strict=True):
        if not parameter.low <= value <= parameter.high:
            raise InvalidRobot(
                f"body.parts[{index}].{parameter.name}: must be in "
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
                f"body.parts[{index}]: parts must be in depth-first order, "
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
