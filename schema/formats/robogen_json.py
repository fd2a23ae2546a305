"""Reader of RoboGen's JSON, the form in which its evolution writes robots.

Source: RoboGen's published sources of 2018.
"""

from schema.errors import InvalidRobot, shown
from schema.formats.document import Table, compose
from schema.formats.robogen import (
    Ending,
    RobogenPart,
    RobogenRobot,
    checked_part,
    neuron_kind,
    our_robot,
)
from schema.parts import BodySpace
from schema.robot.brain import LAYERS
from schema.robot.robot import Robot

_BOOLEANS = ("true", "false")
_DEFAULTS: dict[str, tuple[tuple[str, float], ...]] = {
    "Simple": (("bias", 0.0), ("gain", 1.0)),
    "Sigmoid": (("bias", 0.0), ("gain", 1.0)),
    "Oscillator": (("period", 0.0), ("phaseOffset", 0.0), ("gain", 1.0)),
}
"""Keys of our parameters, and their defaults."""
_NEURON_KEYS = (
    *("id", "layer", "type", "bodyPartId", "ioId"),
    *("bias", "gain", "period", "phaseOffset", "tau"),
)


def robot_from_robogen_json(text: str, where: str, space: BodySpace) -> Robot:
    """Return the robot of RoboGen's JSON form.

    Raises:
        InvalidRobot: not such JSON; the message names file, line and path.
    """
    document = compose(text, where, "JSON")
    document.refuse_others("id", "body", "brain")
    body = document.table("body")
    theirs = RobogenRobot(_body(body, _parts(body, where), where))
    if document.has("brain"):
        _read_brain(document.table("brain"), theirs, where)
    return our_robot(theirs, space, where)


def _read_brain(brain: Table, theirs: RobogenRobot, where: str) -> None:
    """Read neurons and connections."""
    brain.refuse_others("neuron", "connection")
    ends: dict[str, Ending] = {}
    for neuron in brain.tables("neuron"):
        neuron.refuse_others(*_NEURON_KEYS)
        end = (neuron.text("bodyPartId"), neuron.integer("ioId"))
        name = neuron.text("id")
        if name in ends:
            neuron.refuse("id", f"duplicate neuron {shown(name)}")
        layer = neuron.word("layer", LAYERS)
        if layer == "hidden":
            theirs.hidden.append(end)
        if layer != "input":
            kind = neuron_kind(neuron.text("type"), f"{where}:{neuron.line}: type")
            values = [neuron.number(*pair) for pair in _DEFAULTS[kind]]
            theirs.kinds[end] = (kind, tuple(values))
        ends[name] = end
        if len(set(ends.values())) < len(ends):
            neuron.refuse("ioId", f"part {shown(end[0])} has two neurons {end[1]}")
    for edge in brain.tables("connection"):
        edge.refuse_others("src", "dest", "weight")
        source, target = (ends[edge.word(key, ends)] for key in ("src", "dest"))
        theirs.weights.append((source, target, edge.number("weight")))


def _parts(body: Table, where: str) -> dict[str, RobogenPart]:
    """Return the parts by name, without children; the root is first."""
    body.refuse_others("part", "connection")
    parts: dict[str, RobogenPart] = {}
    roots: list[str] = []
    for entry in body.tables("part"):
        entry.refuse_others("id", "type", "root", "orientation", "evolvableParam")
        name = entry.text("id")
        if name in parts:
            entry.refuse("id", f"duplicate part {shown(name)}")
        values = tuple(
            each.number("paramValue") for each in entry.tables("evolvableParam")
        )
        kind, turns = entry.text("type"), entry.integer("orientation")
        at = f"{where}:{entry.line}"
        parts[name] = checked_part(name, kind, turns, values, at)
        if entry.has("root") and entry.word("root", _BOOLEANS) == "true":
            roots.append(name)
    if len(roots) != 1:
        rule = "exactly one must be the root"
        raise InvalidRobot(f"{where}: body.part: {rule}, got {len(roots)}")
    return {roots[0]: parts.pop(roots[0]), **parts}


def _body(body: Table, parts: dict[str, RobogenPart], where: str) -> RobogenPart:
    """Return the root, after attaching all parts to it; it is the first."""
    root, *_ = parts.values()
    attached = {root.name}
    for edge in body.tables("connection"):
        edge.refuse_others("src", "dest", "srcSlot", "destSlot")
        child, parent = (parts[edge.word(key, parts)] for key in ("dest", "src"))
        slot = edge.integer("srcSlot")
        if edge.integer("destSlot") != 0:
            edge.refuse("destSlot", "must be 0: parts attach by their slot 0")
        if child.name in attached:
            edge.refuse("dest", f"{shown(child.name)} is already attached to a part")
        if slot in parent.children or (slot == 0 and parent is not root):
            edge.refuse("srcSlot", f"slot {slot} is taken")
        attached.add(child.name)
        parent.children[slot] = child
    connected = {part.name for part in root.subtree()}
    for name in parts:
        if name not in connected:
            why = f"{shown(name)} is not attached to the core"
            raise InvalidRobot(f"{where}: body.part: {why}")
    return root
