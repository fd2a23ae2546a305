"""Reader of RoboGen's JSON, the form in which its evolution writes robots.

Source: RoboGen's published sources of 2018.
"""

import json
import math
from typing import Any, NoReturn, TypeVar

from schema.errors import InvalidRobot, nearest, one_line, shown
from schema.formats.robogen import (
    Ending,
    RobogenPart,
    RobogenRobot,
    checked_part,
    neuron_kind,
    our_robot,
    two_neurons,
)
from schema.parts import BodySpace
from schema.robot.brain import LAYERS
from schema.robot.robot import Robot

T = TypeVar("T", str, int, float)
K = TypeVar("K")

_KEYS: dict[str, tuple[tuple[str, float], ...]] = {
    "Simple": (("bias", 0.0), ("gain", 1.0)),
    "Sigmoid": (("bias", 0.0), ("gain", 1.0)),
    "Oscillator": (("period", 0.0), ("phaseOffset", 0.0), ("gain", 1.0)),
}
"""Keys of our parameters, and their defaults."""
_FIELDS: dict[str, tuple[str, ...]] = {
    "": ("id", "body", "brain"),
    "body": ("part", "connection"),
    "body.part": ("id", "type", "root", "orientation", "evolvableParam"),
    "evolvableParam": ("paramValue",),
    "body.connection": ("src", "dest", "srcSlot", "destSlot"),
    "brain": ("neuron", "connection"),
    "brain.neuron": (
        *("id", "layer", "type", "bodyPartId", "ioId"),
        *("bias", "gain", "period", "phaseOffset", "tau"),
    ),
    "brain.connection": ("src", "dest", "weight"),
}
"""Keys of each object, as RoboGen writes them."""


def robot_from_robogen_json(text: str, where: str, space: BodySpace) -> Robot:
    """Return the robot of RoboGen's JSON form.

    Args:
        text: of the file.
        where: its name, for messages.
        space: part types that the robot may use.

    Raises:
        InvalidRobot: not such JSON; the message names file and line, or the path.
    """
    try:
        document = json.loads(
            text, parse_constant=_refuse, object_pairs_hook=_without_twins
        )
    except json.JSONDecodeError as error:
        raise InvalidRobot(
            f"{where}:{error.lineno}: not valid JSON: {error.msg}"
        ) from None
    except (ValueError, RecursionError) as error:
        reason = one_line(error).partition(";")[0]
        raise InvalidRobot(f"{where}: not valid JSON: {reason}") from None
    _check_sections(document, where)
    theirs = RobogenRobot(_body(document, where))
    ends: dict[str, Ending] = {}
    taken: set[Ending] = set()
    for at, neuron in _items(document, ("brain", "neuron"), where):
        end = (_get(neuron, "bodyPartId", str, at), _get(neuron, "ioId", int, at))
        name = _get(neuron, "id", str, at)
        if name in ends:
            raise InvalidRobot(f"{at}.id: duplicate neuron {shown(name)}")
        if end in taken:
            raise InvalidRobot(f"{at}: {two_neurons(*end)}")
        ends[name] = end
        taken.add(end)
        layer = _get(neuron, "layer", str, at)
        if layer not in LAYERS:
            allowed = ", ".join(LAYERS)
            raise InvalidRobot(
                f"{at}.layer: must be one of {allowed}, got {shown(layer)}"
            )
        if layer == "hidden":
            theirs.hidden.append(end)
        if layer != "input":
            kind = neuron_kind(_get(neuron, "type", str, at), f"{at}.type")
            values = [
                _get(neuron, key, float, at) if key in neuron else default
                for key, default in _KEYS[kind]
            ]
            theirs.kinds[end] = (kind, tuple(values))
    for at, edge in _items(document, ("brain", "connection"), where):
        source, target = (
            _known(ends, _get(edge, key, str, at), f"{at}.{key}")
            for key in ("src", "dest")
        )
        theirs.weights.append((source, target, _get(edge, "weight", float, at)))
    return our_robot(theirs, space, where)


def _body(document: object, where: str) -> RobogenPart:
    """Return the tree of parts of a document."""
    parts: dict[str, RobogenPart] = {}
    roots: list[RobogenPart] = []
    for at, entry in _items(document, ("body", "part"), where):
        name = _get(entry, "id", str, at)
        if name in parts:
            raise InvalidRobot(f"{at}.id: duplicate part {shown(name)}")
        values = tuple(
            _get(value, "paramValue", float, inner)
            for inner, value in _items(entry, ("evolvableParam",), at)
        )
        kind, turns = _get(entry, "type", str, at), _get(entry, "orientation", int, at)
        parts[name] = checked_part(name, kind, turns, values, at)
        if _is_root(entry, at):
            roots.append(parts[name])
    if len(roots) != 1:
        raise InvalidRobot(
            f"{where}: body.part: exactly one must be the root, got {len(roots)}"
        )
    attached = {roots[0].name}
    for at, entry in _items(document, ("body", "connection"), where):
        child = _known(parts, _get(entry, "dest", str, at), f"{at}.dest")
        parent = _known(parts, _get(entry, "src", str, at), f"{at}.src")
        slot = _get(entry, "srcSlot", int, at)
        if _get(entry, "destSlot", int, at) != 0:
            raise InvalidRobot(
                f"{at}.destSlot: must be 0: parts attach by their slot 0"
            )
        if child.name in attached:
            raise InvalidRobot(
                f"{at}.dest: {shown(child.name)} is already attached to a part"
            )
        if slot in parent.children or (slot == 0 and parent is not roots[0]):
            raise InvalidRobot(f"{at}.srcSlot: slot {slot} is taken")
        attached.add(child.name)
        parent.children[slot] = child
    if separate := [name for name in parts if name not in attached]:
        raise InvalidRobot(
            f"{where}: body.part: {shown(separate[0])} is not attached to any part"
        )
    _check_connected(roots[0], len(parts), where)
    return roots[0]


def _is_root(entry: dict[str, Any], at: str) -> bool:
    """Return whether a part is the root; without the key it is not."""
    is_root = entry.get("root", False)
    if not isinstance(is_root, bool):
        raise InvalidRobot(f"{at}.root: must be true or false, got {shown(is_root)}")
    return is_root


def _check_connected(root: RobogenPart, count: int, where: str) -> None:
    """Raise if some parts form a ring that is not connected to the core."""
    if apart := count - len(root.subtree()):
        raise InvalidRobot(
            f"{where}: body.connection: {apart} parts are not connected to the core"
        )


def _items(
    document: object, path: tuple[str, ...], where: str
) -> list[tuple[str, dict[str, Any]]]:
    """Return (path, entry) of a list in a document; a missing list is empty."""
    value = document
    for key in path:
        if not isinstance(value, dict):
            raise InvalidRobot(f"{where}: must be an object with {key!r}")
        value = value.get(key, {} if key != path[-1] else [])
    name = ".".join(path)
    if not isinstance(value, list):
        raise InvalidRobot(f"{where}: {name} must be a list")
    entries: list[tuple[str, dict[str, Any]]] = []
    for number, entry in enumerate(value):
        if not isinstance(entry, dict):
            raise InvalidRobot(f"{where}: {name}[{number}] must be an object")
        _check_keys(entry, name, f"{where}: {name}[{number}]")
        entries.append((f"{where}: {name}[{number}]", entry))
    return entries


def _check_sections(document: object, where: str) -> None:
    """Raise unless RoboGen has all keys of a document, its body and its brain."""
    if isinstance(document, dict):
        _check_keys(document, "", where)
        for name in ("body", "brain"):
            if isinstance(section := document.get(name), dict):
                _check_keys(section, name, f"{where}: {name}")


def _check_keys(entry: dict[str, Any], name: str, at: str) -> None:
    """Raise unless RoboGen has all keys of an object.

    Args:
        entry: the object.
        name: of such objects in ``_FIELDS``.
        at: its place, for messages.
    """
    for key in entry:
        if key not in _FIELDS[name]:
            near = nearest(key, _FIELDS[name])
            allowed = ", ".join(_FIELDS[name])
            raise InvalidRobot(
                f"{at}: no such key {shown(key)}{near}; allowed: {allowed}"
            )


def _get(entry: dict[str, Any], key: str, kind: type[T], at: str) -> T:
    """Return the value of a key, of a type; integers are accepted as floats."""
    value = entry.get(key)
    if kind is float and isinstance(value, int):
        value = _as_float(value)
    if not isinstance(value, kind) or isinstance(value, bool):
        raise InvalidRobot(
            f"{at}.{key}: must be of type {kind.__name__}, got {shown(value)}"
        )
    return value


def _as_float(value: int) -> float:
    """Return a whole number as a float, infinite if it is too large."""
    try:
        return float(value)
    except OverflowError:
        return math.inf


def _known(named: dict[str, K], name: str, at: str) -> K:
    """Return the value of a name that must exist."""
    if name not in named:
        raise InvalidRobot(f"{at}: unknown name {shown(name)}")
    return named[name]


def _without_twins(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    """Return an object of JSON, in which each key is given once."""
    found: dict[str, Any] = {}
    for key, value in pairs:
        if key in found:
            raise ValueError(f"key {shown(key)} is given twice")
        found[key] = value
    return found


def _refuse(name: str) -> NoReturn:
    raise ValueError(f"{name} is not allowed")
