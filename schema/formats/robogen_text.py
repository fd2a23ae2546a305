"""Reader of RoboGen's indented text.

The text has four sections, separated by empty lines: parts, one per line, indented
by tabs below their parents; hidden neurons; weights; neuron parameters. Only the
first is required.
Source: RoboGen's published sources of 2018.
"""

import math
import re
from collections.abc import Iterator

from schema.errors import InvalidRobot, check_most, shown
from schema.formats.robogen import (
    RobogenPart,
    RobogenRobot,
    checked_part,
    neuron_kind,
    our_robot,
)
from schema.limits import MOST_LINE
from schema.parts import BUILT_IN, BodySpace
from schema.robot.robot import Robot

_LETTERS = {
    "E": "CoreComponent",
    "N": "CoreComponentNoIMU",
    "F": "FixedBrick",
    "I": "ActiveHinge",
    "H": "PassiveHinge",
    "B": "ParametricJoint",
    "T": "TouchSensor",
    "L": "LightSensor",
}
_NOT_SUPPORTED = {
    "C": "PassiveCardan",
    "D": "IrSensor",
    "G": "ActiveWheg",
    "J": "ActiveWheel",
    "K": "ActiveCardan",
    "R": "Rotator",
    "W": "PassiveWheel",
}
"""Further letters, whose types have no counterpart; messages name the types."""
_DUMPS = {"Fitness:": "report", "Robot-Body": "report", "id:": "Protobuf text"}
"""Other files that RoboGen wrote, by the first word."""
_DIGITS = 9
"""Most digits of a neuron's number."""
_PART = re.compile(r"(\t*)(\d) (\S+) (\S+) (\d)((?: \S+)*)\s*")


def robot_from_robogen_text(text: str, where: str, space: BodySpace) -> Robot:
    """Return the robot of RoboGen's text form.

    Raises:
        InvalidRobot: not such a text; the message names file, line and what is allowed.
    """
    sections = _sections(text, where)
    root = _body(next(sections), where)
    # Of each part: its input and output neurons, then the hidden ones so far.
    numbers: dict[str, int] = {}
    for part in root.subtree():
        kind = BUILT_IN[part.kind]
        numbers[part.name] = kind.outputs + (kind.inputs if part.has_imu else 0)
    theirs = RobogenRobot(root)
    for line, words in next(sections, []):
        name, type_name = _exactly(words, ("PART", "TYPE"), line)
        if name not in numbers:
            raise InvalidRobot(f"{line}: no part {shown(name)}")
        theirs.hidden.append((name, numbers[name]))
        # The last section overrides it.
        theirs.kinds[theirs.hidden[-1]] = (neuron_kind(type_name, line), (0.0, 1.0))
        numbers[name] += 1
    for line, words in next(sections, []):
        names = ("PART", "NUMBER", "PART", "NUMBER", "WEIGHT")
        source, one, target, two, weight = _exactly(words, names, line)
        ends = (source, _count(one, line)), (target, _count(two, line))
        theirs.weights.append((*ends, _number(weight, line)))
    for line, words in next(sections, []):
        _read_parameters(theirs, words, line)
    if rest := next(sections, []):
        raise InvalidRobot(f"{rest[0][0]}: a fifth section; at most four are allowed")
    return our_robot(theirs, space, where)


def _sections(text: str, where: str) -> Iterator[list[tuple[str, list[str]]]]:
    """Yield sections as lists of (file and line, words); the first is not split."""
    section: list[tuple[str, list[str]]] = []
    is_body = True
    for number, line in enumerate(text.splitlines(), start=1):
        at = f"{where}:{number}"
        check_most(len(line), MOST_LINE, "characters", at, InvalidRobot)
        if line.strip():
            section.append((at, [line] if is_body else line.split()))
        else:
            yield section
            section, is_body = [], False
    yield section


def _body(lines: list[tuple[str, list[str]]], where: str) -> RobogenPart:
    """Return the tree of parts of the first section."""
    if not lines:
        raise InvalidRobot(f"{where}:1: must be the core, got an empty line")
    if dump := _DUMPS.get(lines[0][1][0].split()[0]):
        what = f"a RoboGen {dump} of an individual is not supported"
        raise InvalidRobot(f"{where}:1: {what}: only its robot text and JSON are")
    path: list[RobogenPart] = []
    names: set[str] = set()
    for line, (written,) in lines:
        match = _PART.fullmatch(written)
        if match is None:
            form = "TABS SLOT TYPE NAME ORIENTATION PARAMETERS"
            raise InvalidRobot(f"{line}: must be {form}, got {shown(written)}")
        tabs, slot, kind, name, turns, rest = match.groups()
        kind = _LETTERS.get(kind) or _NOT_SUPPORTED.get(kind, kind)
        values = tuple(_number(word, line) for word in rest.split())
        part = checked_part(name, kind, int(turns), values, line)
        depth = len(tabs)
        if name in names:
            raise InvalidRobot(f"{line}: duplicate part {shown(name)}")
        names.add(name)
        if (depth == 0) != (not path) or depth > len(path):
            allowed = f"1..{len(path)}" if path else "0"
            raise InvalidRobot(f"{line}: tabs must be {allowed}, got {depth}")
        del path[depth:]
        if path:
            _graft(path[-1], int(slot), part)
        path.append(part)
    return path[0]


def _graft(parent: RobogenPart, slot: int, child: RobogenPart) -> None:
    """Attach a part to its parent by the slot number in the text."""
    # Slot 0 of all parts but the core attaches them to their parent: not numbered.
    own = slot + (parent.kind != "Core")
    if own in parent.children:
        taken = f"slot {slot} of {shown(parent.name)} is taken"
        raise InvalidRobot(f"{child.where}: {taken}")
    count = BUILT_IN[parent.kind].arity
    if own >= count:
        free = count - (parent.kind != "Core")
        few = f"{shown(parent.name)} has {free} free slots, got slot {slot}"
        raise InvalidRobot(f"{child.where}: {few}")
    parent.children[own] = child


def _read_parameters(theirs: RobogenRobot, words: list[str], line: str) -> None:
    """Read a line of the last section: a bias, or a type and its parameters."""
    if len(words) <= len(("PART", "NUMBER", "BIAS")):
        words = _exactly(words, ("PART", "NUMBER", "BIAS"), line)
        words.insert(2, "sigmoid")
    part, number, name, *rest = words
    kind = neuron_kind(name, line)
    values = tuple(_number(word, line) for word in rest)
    wanted = 3 if kind == "Oscillator" else 1
    if len(values) != wanted:
        raise InvalidRobot(f"{line}: {name} takes {wanted} numbers, got {len(values)}")
    # Only oscillators have a gain in the text.
    gain = () if kind == "Oscillator" else (1.0,)
    theirs.kinds[part, _count(number, line)] = (kind, (*values, *gain))


def _exactly(words: list[str], names: tuple[str, ...], line: str) -> list[str]:
    if len(words) != len(names):
        raise InvalidRobot(
            f"{line}: must be {' '.join(names)}, got {shown(' '.join(words))}"
        )
    return words


def _count(word: str, line: str) -> int:
    if not (word.isdecimal() and len(word) <= _DIGITS):
        raise InvalidRobot(f"{line}: must be a neuron's number, got {shown(word)}")
    return int(word)


def _number(word: str, line: str) -> float:
    try:
        value = float(word)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise InvalidRobot(f"{line}: must be a number, got {shown(word)}")
    return value
