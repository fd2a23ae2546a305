"""RoboGen's robots: its part tree and network, made into ours.

RoboGen counts slots and quarter turns by frames of its own, and keeps bricks level
and tilting bars flat whatever their file says. Here each part gets the slot and the
orientation that bring it into the same place.
Source: RoboGen's published sources of 2018, planar bodies as it builds them.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from math import pi

from schema.errors import InvalidRobot
from schema.formats.robogen_frames import SQUARE, our_orientation, our_slot
from schema.parts import BUILT_IN, BodySpace
from schema.robot.brain import INPUT, Brain, Connection, Layer, Neuron
from schema.robot.robot import Part, Robot, check_robot, part_type

Ending = tuple[str, int]
"""A neuron's name in RoboGen: part and number among that part's neurons."""

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
"""RoboGen's part types that have a counterpart; without IMU: it feeds nobody."""

_NEURONS = {
    "simple": "Simple",
    "sigmoid": "Sigmoid",
    "logistic": "Sigmoid",
    "oscillator": "Oscillator",
}

_BAR_NUMBERS = 3
"""Length, alpha, beta; no other part has numbers."""

_ROOT_TURNS = (2, 0, 3, 3)
"""By RoboGen's slot of a square part: quarter turns that its children inherit."""
_GREY = (0.5, 0.5, 0.5)


@dataclass(slots=True)
class RobogenPart:
    """A part as RoboGen's files have it.

    Attributes:
        name: unique in its file.
        kind: our name of its type.
        orientation: quarter turns, 0..3.
        parameters: as written: length [m], alpha and beta [degrees].
        where: file and line or path, for messages.
        children: by RoboGen's slot; those that are not square count from slot 1.
    """

    name: str
    kind: str
    orientation: int
    parameters: tuple[float, ...]
    where: str
    children: dict[int, "RobogenPart"] = field(default_factory=dict)


@dataclass(slots=True)
class RobogenRobot:
    """A robot as RoboGen's files have it.

    Attributes:
        root: the core.
        hidden: name of each hidden neuron's part, with its number there.
        kinds: type and parameters of neurons that are not said to be as usual.
        weights: (source, target, weight).
    """

    root: RobogenPart
    hidden: list[Ending] = field(default_factory=list)
    kinds: dict[Ending, tuple[str, tuple[float, ...]]] = field(default_factory=dict)
    weights: list[tuple[Ending, Ending, float]] = field(default_factory=list)


USUAL: tuple[str, tuple[float, ...]] = ("Sigmoid", (0.0, 1.0))
"""A neuron that nothing is said of: bias 0, gain 1."""


def checked_part(
    name: str, kind: str, turns: int, values: tuple[float, ...], where: str
) -> RobogenPart:
    """Return a part of a file, still without children.

    Args:
        name: unique in its file.
        kind: RoboGen's type.
        turns: quarter turns.
        values: parameters as written.
        where: file and line or path, for messages.

    Raises:
        InvalidRobot: a type that has no counterpart, another number of turns or
            parameters than there can be.
    """
    if kind not in KINDS:
        allowed = ", ".join(KINDS)
        raise InvalidRobot(f"{where}: type must be one of {allowed}, got {kind!r}")
    if turns not in range(4):
        raise InvalidRobot(f"{where}: orientation must be 0..3, got {turns}")
    ours = KINDS[kind]
    wanted = _BAR_NUMBERS if ours == "ParametricBarJoint" else 0
    if len(values) != wanted:
        raise InvalidRobot(f"{where}: {kind} takes {wanted} numbers, got {len(values)}")
    return RobogenPart(name, ours, turns, values, where)


def neuron_kind(name: str, where: str) -> str:
    """Return our type of a neuron.

    Raises:
        InvalidRobot: none of ours.
    """
    if name.lower() not in _NEURONS:
        allowed = ", ".join(_NEURONS)
        raise InvalidRobot(f"{where}: must be one of {allowed}, got {name!r}")
    return _NEURONS[name.lower()]


def our_robot(theirs: RobogenRobot, space: BodySpace, where: str) -> Robot:
    """Return a RoboGen robot as ours.

    Args:
        theirs: as read from a file.
        space: its part types; ``schema.robogen_parts`` has RoboGen's dimensions.
        where: the file's name, for messages.

    Raises:
        InvalidRobot: a slot that a part does not have, a number that a part type
            does not allow, a neuron or its part that is not there.
    """
    body = _Body()
    body.add(theirs.root, (-1, -1, -1), 0, 0)
    neurons, index = _neurons(theirs, body, space)
    ends = (end for *pair, _ in theirs.weights for end in pair)
    for name, number in (*theirs.kinds, *ends):
        if (name, number) not in index:
            raise InvalidRobot(f"{where}: no neuron {number} on part {name!r}")
    connections = []
    for source, target, weight in theirs.weights:
        # RoboGen takes connections to an oscillator off: it does not listen.
        if neurons[index[target]].kind != "Oscillator":
            connections.append(Connection(index[source], index[target], weight))
    robot = Robot(tuple(body.parts), Brain(tuple(neurons), tuple(connections)))
    try:
        check_robot(robot, space)
    except InvalidRobot as error:
        raise InvalidRobot(f"{where}: {error}") from None
    return robot


@dataclass(slots=True)
class _Body:
    """Our parts so far, and RoboGen's names of them."""

    parts: list[Part] = field(default_factory=list)
    names: list[str] = field(default_factory=list)

    def add(
        self, part: RobogenPart, place: tuple[int, int, int], turn: int, turns: int
    ) -> None:
        """Add a part and all that it carries.

        Args:
            part: RoboGen's.
            place: index of its parent, slot there, own slot.
            turn: our orientation of it [degrees].
            turns: quarter turns from the core to it, as RoboGen counts them.
        """
        own = len(self.parts)
        self.names.append(part.name)
        values = (*_parameters(part), *_GREY)
        self.parts.append(Part(part.kind, *place, turn, values))
        is_square = part.kind in SQUARE
        by_slot: dict[int, tuple[int, RobogenPart]] = {}
        for slot, child in part.children.items():
            if not 0 <= slot < BUILT_IN[part.kind].arity:
                raise InvalidRobot(f"{child.where}: {part.kind} has no slot {slot}")
            by_slot[our_slot(part.kind, slot)] = slot, child
        for place_there in sorted(by_slot):
            slot, child = by_slot[place_there]
            inherited = turns + (_ROOT_TURNS[slot] if is_square else 0)
            quarter, child_turns = _levelled(child, inherited)
            child_turn = our_orientation(part.kind, slot, child.kind, quarter)
            sits = (own, place_there, our_slot(child.kind, 0))
            self.add(child, sits, child_turn, child_turns)


def _levelled(part: RobogenPart, inherited: int) -> tuple[int, int]:
    """Return the quarter turns that RoboGen gives a part, and those to its children."""
    to_root = (part.orientation + inherited) % 4
    upright = {"FixedBrick": 0, "ParametricBarJoint": 1}.get(part.kind, to_root)
    return (part.orientation + upright - to_root) % 4, upright


def _parameters(part: RobogenPart) -> tuple[float, ...]:
    """Return a part's own parameters in our units."""
    if part.kind != "ParametricBarJoint":
        return ()
    length_m, alpha, beta = part.parameters
    return length_m * 1000.0, alpha * pi / 180.0, beta * pi / 180.0


def _neurons(
    theirs: RobogenRobot, body: _Body, space: BodySpace
) -> tuple[list[Neuron], dict[Ending, int]]:
    """Return our neurons in their order, and where RoboGen's names lead."""
    neurons: list[Neuron] = []
    index: dict[Ending, int] = {}

    def add(layer: Layer, part: int, end: Ending) -> None:
        kind, values = theirs.kinds.get(end, USUAL)
        if layer == "input":
            kind, values = INPUT, ()
        index[end] = len(neurons)
        neurons.append(Neuron(layer, kind, part, values))

    types = [part_type(part.kind, space, "body") for part in body.parts]
    for part, kind in enumerate(types):
        for number in range(kind.inputs):
            add("input", part, (body.names[part], number))
    for part, kind in enumerate(types):
        for number in range(kind.outputs):
            add("output", part, (body.names[part], number))
    for part, name in enumerate(body.names):
        for end in theirs.hidden:
            if end[0] == name:
                add("hidden", part, end)
    return neurons, index
