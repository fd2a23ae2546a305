"""Robots: a tree of parts and a brain, the phenotype that is simulated.

Parts are in a flat tuple in depth-first order (children by ascending slot of their
parent). Each part has the index of its parent; index 0 is the core.
"""

import math
from collections.abc import Sequence
from typing import Annotated

from msgspec import Meta, Struct

from schema.errors import InvalidRobot, check_most, shown
from schema.limits import MOST_NEURONS, MOST_PARTS, Finite
from schema.parts import BodySpace, PartType
from schema.robot.brain import Brain, NeuronKinds, check_brain, check_neurons
from schema.robot.cpg import BUILT_IN_KINDS

ORIENTATIONS = (0, 90, 180, 270)
GENES = 2**64
"""Number of possible identities."""
NO_BRAIN = Brain()


class Part(Struct, frozen=True, gc=False, array_like=True, forbid_unknown_fields=True):
    """Part of a body.

    Attributes:
        kind: name of its part type.
        parent: index of its parent; -1 for the core.
        parent_slot: slot of the parent that holds it; -1 for the core.
        slot: own slot by which it is attached; -1 for the core.
        orientation: rotation about the normal of its own slot [degrees].
        parameters: values in the order of its type's ``parameters``.
        gene: identity that the part inherits from its ancestors; 0 is none.
    """

    kind: str
    parent: int
    parent_slot: int
    slot: int
    orientation: int
    parameters: tuple[Finite, ...]
    gene: int = 0


class Robot(Struct, frozen=True, gc=False, array_like=True, forbid_unknown_fields=True):
    """A body and its brain."""

    parts: Annotated[tuple[Part, ...], Meta(max_length=MOST_PARTS)]
    brain: Brain = NO_BRAIN


def motor_count(robot: Robot, space: BodySpace) -> int:
    """Return the number of motors of a robot of these part types."""
    return sum(space[part.kind].outputs for part in robot.parts)


def check_tree(parts: Sequence[Part]) -> None:
    """Raise unless parts form a tree; types are not checked.

    Raises:
        InvalidRobot: another order, a slot used twice, a number out of its range.
    """
    if not parts:
        raise InvalidRobot("body: must have at least the core")
    taken: set[tuple[int, int]] = set()
    for index, part in enumerate(parts):
        # Build messages only on errors: this runs for each birth in each process.
        if problem := _place_problem(part, index) or _value_problem(part):
            raise InvalidRobot(f"body.parts[{index}]{problem}")
        if index == 0:
            continue
        for end in ((part.parent, part.parent_slot), (index, part.slot)):
            if end in taken:
                place = f"slot {shown(end[1])} of body.parts[{end[0]}]"
                raise InvalidRobot(f"body.parts[{index}]: {place} is taken")
            taken.add(end)
    _check_order(parts)


def _place_problem(part: Part, index: int) -> str:
    """Return what is wrong with the position of a part in the tree, or nothing."""
    if index == 0:
        if (part.parent, part.parent_slot, part.slot) == (-1, -1, -1):
            return ""
        got = f"{part.parent}, {part.parent_slot}, {part.slot}"
        return f": the core's parent, parent_slot and slot must be -1, got {got}"
    if not 0 <= part.parent < index:
        return f".parent: must be 0..{index - 1}, got {part.parent}"
    if part.parent_slot < 0:
        return f".parent_slot: must be >= 0, got {shown(part.parent_slot)}"
    return f".slot: must be >= 0, got {shown(part.slot)}" if part.slot < 0 else ""


def _value_problem(part: Part) -> str:
    if part.orientation not in ORIENTATIONS:
        got = shown(part.orientation)
        return f".orientation: must be one of {ORIENTATIONS}, got {got}"
    if not all(map(math.isfinite, part.parameters)):
        return ".parameters: must be finite"
    if not 0 <= part.gene < GENES:
        return f".gene: must be 0..2^64-1, got {shown(part.gene)}"
    return ""


def check_robot(
    robot: Robot, space: BodySpace, kinds: NeuronKinds = BUILT_IN_KINDS
) -> None:
    """Raise unless a robot is well formed in a body space.

    The analyzer checks intersections of parts.

    Raises:
        InvalidRobot: as of ``check_tree``; what the types of parts do not have; a brain
            that breaks its rules or does not fit the body.
    """
    check_tree(robot.parts)
    check_brain(robot.brain, len(robot.parts))
    check_neurons(robot.brain, kinds)
    check_types(robot, space)


def check_number(robot: Robot) -> None:
    """Raise ``InvalidRobot`` if a robot has more parts or neurons than a file may."""
    check_most(len(robot.parts), MOST_PARTS, "parts", "body", InvalidRobot)
    neurons = len(robot.brain.neurons)
    check_most(neurons, MOST_NEURONS, "neurons", "brain", InvalidRobot)


def check_types(robot: Robot, space: BodySpace) -> None:
    """Raise, as ``check_robot``, unless a robot fits a body space; not for neurons."""
    check_body(robot.parts, space)
    _check_wiring(robot, space)


def check_body(parts: Sequence[Part], space: BodySpace) -> None:
    """Raise, as ``check_robot``, unless a body fits a body space."""
    for index, part in enumerate(parts):
        if problem := _type_problem(part, index, space):
            raise InvalidRobot(f"body.parts[{index}]{problem}")
        if index == 0:
            continue
        for name, slot, kind in (
            ("parent_slot", part.parent_slot, space[parts[part.parent].kind]),
            ("slot", part.slot, space[part.kind]),
        ):
            if slot >= kind.arity:
                slots = f"{kind.name} has slots 0..{kind.arity - 1}, got {shown(slot)}"
                raise InvalidRobot(f"body.parts[{index}].{name}: {slots}")


def _type_problem(part: Part, index: int, space: BodySpace) -> str:
    kind = space.get(part.kind) or part_type(part.kind, space, f"body.parts[{index}]")
    if kind.is_root != (index == 0):
        return f": exactly the first part must be a core, got {part.kind}"
    if len(part.parameters) != len(kind.parameters):
        wanted = f"{part.kind} takes {len(kind.parameters)}"
        return f".parameters: {wanted}, got {len(part.parameters)}"
    for parameter, value in zip(kind.parameters, part.parameters, strict=True):
        if not parameter.low <= value <= parameter.high:
            allowed = f"[{parameter.low}, {parameter.high}]"
            return f".{parameter.name}: must be in {allowed}, got {value}"
    return ""


def part_type(name: str, space: BodySpace, where: str) -> PartType:
    """Return the part type of a name; ``InvalidRobot`` if the body space has none."""
    if name not in space:
        rule = f"must be one of {', '.join(space)}, got {name!r}"
        raise InvalidRobot(f"{where}.kind: {rule}")
    return space[name]


def _check_order(parts: Sequence[Part]) -> None:
    """Raise unless parts are in depth-first order, children by ascending slot."""
    path: list[int] = []
    last_slot: dict[int, int] = {}
    for index, part in enumerate(parts):
        while path and path[-1] != part.parent:
            path.pop()
        is_first = index == 0
        if not is_first and (
            not path or last_slot.get(part.parent, -1) >= part.parent_slot
        ):
            order = "parts must be in depth-first order, children by ascending slot"
            raise InvalidRobot(f"body.parts[{index}]: {order}")
        last_slot[part.parent] = part.parent_slot
        path.append(index)


def _check_wiring(robot: Robot, space: BodySpace) -> None:
    kinds = [space[part.kind] for part in robot.parts]
    inputs, outputs = [kind.inputs for kind in kinds], [kind.outputs for kind in kinds]
    for layer, counts in (("input", inputs), ("output", outputs)):
        expected = [part for part, count in enumerate(counts) for _ in range(count)]
        owners = [n.part for n in robot.brain.neurons if n.layer == layer]
        if owners != expected:
            rule = f"must belong to parts {expected}, got {owners}"
            raise InvalidRobot(f"brain: {layer} neurons {rule}")
