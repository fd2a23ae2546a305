"""Conversion of RoboGen's part tree and network into a robot.

RoboGen has its own frames for slots and quarter turns, and it levels bricks and
tilting bars whatever the file says. Each part gets the slot and the orientation that
give it the same pose.
Source: RoboGen's published sources of 2018, planar bodies as it builds them.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from functools import lru_cache
from math import isclose, pi

import numpy as np

from schema.errors import InvalidRobot, shown
from schema.formats.yaml_reader import with_ids
from schema.parts import BUILT_IN, MINUS_X, MINUS_Y, BodySpace, Slot, X, Y, Z
from schema.robot.brain import INPUT, Brain, Connection, Layer, Neuron
from schema.robot.frames import attach
from schema.robot.robot import (
    ORIENTATIONS,
    Part,
    Robot,
    check_number,
    check_robot,
    part_type,
)

Ending = tuple[str, int]
"""RoboGen's name of a neuron: part, and number among the part's neurons."""

KINDS: Mapping[str, str] = {
    "CoreComponent": "Core",
    "CoreComponentNoIMU": "Core",
    "FixedBrick": "FixedBrick",
    "ActiveHinge": "ActiveHinge",
    "PassiveHinge": "Hinge",
    "ParametricJoint": "ParametricBarJoint",
    "TouchSensor": "TouchSensor",
    "LightSensor": "LightSensor",
}
"""Our part types by RoboGen's; a core without IMU has unconnected inputs."""
_NO_IMU = "CoreComponentNoIMU"

_NEURONS = {
    "simple": "Simple",
    "sigmoid": "Sigmoid",
    "logistic": "Sigmoid",
    "oscillator": "Oscillator",
}

_BAR_NUMBERS = 3
"""Length, alpha, beta; no other part type has parameters in RoboGen."""

_ROOT_TURNS = (2, 0, 3, 3)
"""Quarter turns that children inherit, by RoboGen's slot of a square part."""
_GREY = (0.5, 0.5, 0.5)
_SINGLE = 2.0**-23
"""Relative rounding of RoboGen's single precision: its 0.1 m are 100.0000015 mm."""


@dataclass(slots=True)
class RobogenPart:
    """Part of a RoboGen file.

    Attributes:
        name: unique in the file.
        kind: Revolve's name of the part type.
        orientation: quarter turns, 0..3.
        parameters: as in the file: length [m], alpha and beta [degrees].
        where: file and line or path, and name, for messages.
        has_imu: false of a core whose inputs RoboGen does not have.
        children: by RoboGen's slot; parts that are not square number them from 1.
    """

    name: str
    kind: str
    orientation: int
    parameters: tuple[float, ...]
    where: str
    has_imu: bool = True
    children: dict[int, "RobogenPart"] = field(default_factory=dict)

    def subtree(self) -> list["RobogenPart"]:
        """Return the part and all parts below it."""
        found = [self]
        for part in found:
            found += part.children.values()
        return found


@dataclass(slots=True)
class RobogenRobot:
    """Robot of a RoboGen file.

    Attributes:
        kinds: types and parameters of neurons that differ from ``USUAL``.
        weights: (source, target, weight) of each connection.
    """

    root: RobogenPart
    hidden: list[Ending] = field(default_factory=list)
    kinds: dict[Ending, tuple[str, tuple[float, ...]]] = field(default_factory=dict)
    weights: list[tuple[Ending, Ending, float]] = field(default_factory=list)


USUAL: tuple[str, tuple[float, ...]] = ("Sigmoid", (0.0, 1.0))
"""Default type and parameters of a neuron: bias 0, gain 1."""


def checked_part(
    name: str, kind: str, turns: int, values: tuple[float, ...], where: str
) -> RobogenPart:
    """Return a part without children, after checking its fields.

    Raises:
        InvalidRobot: an unknown type, wrong turns, or a wrong number of parameters.
    """
    at = f"{where}: part {shown(name)}"
    if kind not in KINDS:
        allowed = f"must be one of {', '.join(KINDS)}"
        raise InvalidRobot(f"{at}: type {shown(kind)} is not supported: {allowed}")
    if turns not in range(4):
        raise InvalidRobot(f"{at}: orientation must be 0..3, got {shown(turns)}")
    ours = KINDS[kind]
    wanted = _BAR_NUMBERS if ours == "ParametricBarJoint" else 0
    if len(values) != wanted:
        raise InvalidRobot(f"{at}: {kind} takes {wanted} numbers, got {len(values)}")
    return RobogenPart(name, ours, turns, values, at, kind != _NO_IMU)


def neuron_kind(name: str, where: str) -> str:
    """Return Revolve's type of a neuron, given RoboGen's; else ``InvalidRobot``."""
    if name.lower() not in _NEURONS:
        allowed = ", ".join(_NEURONS)
        raise InvalidRobot(f"{where}: must be one of {allowed}, got {shown(name)}")
    return _NEURONS[name.lower()]


def our_robot(theirs: RobogenRobot, space: BodySpace, where: str) -> Robot:
    """Return the robot of a RoboGen file.

    Raises:
        InvalidRobot: a wrong slot, parameter, neuron or part.
    """
    body = _Body()
    try:
        body.add(theirs.root, (-1, -1, -1), 0, 0)
    except RecursionError:
        raise InvalidRobot(f"{where}: nested too deeply") from None
    neurons, index = _neurons(theirs, body, space, where)
    ends = (end for *pair, _ in theirs.weights for end in pair)
    for name, number in (*theirs.kinds, *ends):
        if (name, number) not in index:
            what = f"no neuron {shown(number)} on part {shown(name)}"
            raise InvalidRobot(f"{where}: {what}")
    connections = []
    for source, target, weight in theirs.weights:
        # RoboGen ignores connections to oscillators.
        if neurons[index[target]].kind != "Oscillator":
            connections.append(Connection(index[source], index[target], weight))
    robot = Robot(tuple(body.parts), Brain(tuple(neurons), tuple(connections)))
    try:
        check_number(robot)
        check_robot(robot, space)
    except InvalidRobot as error:
        names = {place: f"{part} {number}" for (part, number), place in index.items()}
        known = [names.get(place, "imu") for place in range(len(neurons))]
        links = [(known[edge.source], known[edge.target]) for edge in connections]
        message = with_ids(str(error), body.names, known, links)
        raise InvalidRobot(f"{where}: {message}") from None
    return robot


@dataclass(slots=True)
class _Body:
    """Revolve's parts so far, and their names in RoboGen."""

    parts: list[Part] = field(default_factory=list)
    names: list[str] = field(default_factory=list)

    def add(
        self, part: RobogenPart, place: tuple[int, int, int], turn: int, turns: int
    ) -> None:
        """Add a part of RoboGen, turned by some degrees, and its subtree.

        Its place is the index of its parent, the slot there, and its own slot;
        ``turns`` is the sum of RoboGen's quarter turns from the core to it.
        """
        own = len(self.parts)
        self.names.append(part.name)
        values = (*_parameters(part), *_GREY)
        self.parts.append(Part(part.kind, *place, turn, values))
        is_square = part.kind in SQUARE
        by_slot: dict[int, tuple[int, RobogenPart]] = {}
        for slot, child in part.children.items():
            if not 0 <= slot < BUILT_IN[part.kind].arity:
                missing = f"{shown(part.name)} has no slot {shown(slot)}"
                raise InvalidRobot(f"{child.where}: {missing}")
            by_slot[our_slot(part.kind, slot)] = slot, child
        for parent_slot in sorted(by_slot):
            slot, child = by_slot[parent_slot]
            inherited = turns + (_ROOT_TURNS[slot] if is_square else 0)
            quarter, child_turns = _levelled(child, inherited)
            child_turn = our_orientation(part.kind, slot, child.kind, quarter)
            place = (own, parent_slot, our_slot(child.kind, 0))
            self.add(child, place, child_turn, child_turns)


def _levelled(part: RobogenPart, inherited: int) -> tuple[int, int]:
    """Return RoboGen's quarter turns of a part, and those that children inherit."""
    to_root = (part.orientation + inherited) % 4
    upright = {"FixedBrick": 0, "ParametricBarJoint": 1}.get(part.kind, to_root)
    return (part.orientation + upright - to_root) % 4, upright


def _parameters(part: RobogenPart) -> tuple[float, ...]:
    """Return the parameters of a part in Revolve's units, in range but for rounding."""
    if part.kind != "ParametricBarJoint":
        return ()
    length_m, alpha, beta = part.parameters
    values = length_m * 1000.0, alpha * pi / 180.0, beta * pi / 180.0
    pairs = zip(values, BUILT_IN[part.kind].parameters, strict=False)
    near = [(value, min(max(value, own.low), own.high)) for value, own in pairs]
    return tuple(end if isclose(value, end, rel_tol=_SINGLE) else value
                 for value, end in near)  # fmt: skip


def _neurons(
    theirs: RobogenRobot, body: _Body, space: BodySpace, where: str
) -> tuple[list[Neuron], dict[Ending, int]]:
    """Return Revolve's neurons in order, and their indices by RoboGen's names.

    The inputs of a core without IMU have no such names.
    """
    neurons: list[Neuron] = []
    index: dict[Ending, int] = {}
    for layer, part, end in _ends(theirs, body, space):
        kind, values = theirs.kinds.get(end, USUAL)
        if layer == "input":
            kind, values = INPUT, ()
        if layer != "input" or part or theirs.root.has_imu:
            if end in index:
                what = f"part {shown(end[0])} has two neurons {end[1]}"
                raise InvalidRobot(f"{where}: {what}")
            index[end] = len(neurons)
        neurons.append(Neuron(layer, kind, part, values))
    return neurons, index


def _ends(
    theirs: RobogenRobot, body: _Body, space: BodySpace
) -> Iterator[tuple[Layer, int, Ending]]:
    """Yield layer, part and RoboGen's name of each neuron in Revolve's order."""
    types = [part_type(part.kind, space, "body") for part in body.parts]
    for part, kind in enumerate(types):
        for number in range(kind.inputs):
            yield "input", part, (body.names[part], number)
    for part, kind in enumerate(types):
        for number in range(kind.outputs):
            yield "output", part, (body.names[part], number)
    hidden: dict[str, list[Ending]] = {}
    for end in theirs.hidden:
        hidden.setdefault(end[0], []).append(end)
    for part, name in enumerate(body.names):
        for end in hidden.get(name, ()):
            yield "hidden", part, end


SQUARE = ("Core", "FixedBrick")
"""Parts whose slots RoboGen numbers left, right, front, back."""

_OUR_SLOTS = (3, 2, 0, 1)


def our_slot(kind: str, slot: int) -> int:
    """Return Revolve's number of a slot, given RoboGen's."""
    return _OUR_SLOTS[slot] if kind in SQUARE else slot


@lru_cache(maxsize=256)
def our_orientation(parent: str, slot: int, child: str, quarter: int) -> int:
    """Return the orientation [degrees] that matches RoboGen's quarter turns.

    The types are Revolve's, the slot of the parent is RoboGen's; the child is attached
    by its first slot.
    """
    # RoboGen turns the child about its own normal, we turn the tangent: opposite.
    turn = (-90 * quarter) % 360
    wanted, _ = attach(_their_slot(parent, slot), _their_slot(child, 0), turn)
    ours = (
        _our_slot(parent, our_slot(parent, slot)),
        _our_slot(child, our_slot(child, 0)),
    )
    for orientation in ORIENTATIONS:
        rotation, _ = attach(*ours, orientation)
        if np.allclose(rotation, wanted, atol=1e-9):
            return orientation
    raise AssertionError("one of four quarter turns must match")


def _their_slot(kind: str, slot: int) -> Slot:
    """Return RoboGen's slot at the origin, without tilt."""
    if kind in SQUARE:
        normal = (MINUS_X, X, MINUS_Y, Y)[slot]
        return Slot((0.0, 0.0, 0.0), normal, (Y, Y, Z, Z)[slot])
    return Slot((0.0, 0.0, 0.0), X if slot else MINUS_X, Y)


def _our_slot(kind: str, slot: int) -> Slot:
    """Return Revolve's slot, without tilt."""
    part_type = BUILT_IN[kind]
    values = tuple(parameter.default for parameter in part_type.parameters)
    return part_type.shape(values).slots[slot]
