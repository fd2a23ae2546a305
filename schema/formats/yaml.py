"""Robots as YAML, the form for people: writer and reader.

::

    revolve_robot: 1
    body:
      id: part-0
      type: Core
      gene: 1
      params: {red: 0.5, green: 0.5, blue: 0.5}
      children:
        2:                       # slot of the core
          slot: 0                # own slot
          id: leg
          type: ActiveHinge
          orientation: 90
    brain:
      neurons:
      - {id: leg-out-0, part: leg, layer: output, type: Oscillator}
      connections:
      - {source: part-0-in-2, target: leg-out-0, weight: 0.25}

Defaults of omitted keys: a parameter its default, an orientation or gene 0, an id
``part-<index>``, and for neurons ``<part>-in-k``, ``<part>-out-k`` or
``<part>-hidden-k``. Input neurons follow from the sensors: connections name them, but
they are not written. Floats are written with all digits and read back bit for bit.
"""

import re
from typing import Any

import yaml

from schema.errors import InvalidRobot, shown
from schema.formats.yaml_node import Table
from schema.parts import BodySpace, Parameter
from schema.robot.brain import (
    INPUT,
    LAYERS,
    Brain,
    Connection,
    Layer,
    Neuron,
    NeuronKinds,
    neuron_names,
)
from schema.robot.cpg import BUILT_IN_KINDS
from schema.robot.robot import Part, Robot, check_number, check_robot

VERSION = 1
_WRITTEN: tuple[Layer, ...] = ("output", "hidden")
_INDEXED = re.compile(r"(?:body\.parts|brain\.(?:neurons|connections))\[\d+\](\.\w+)?")


def robot_to_yaml(
    robot: Robot, space: BodySpace, kinds: NeuronKinds = BUILT_IN_KINDS
) -> str:
    """Return the YAML text of a robot.

    Raises:
        InvalidRobot: the robot is not well formed in this body space, or has neurons
            of other kinds.
    """
    check_robot(robot, space, kinds)
    entries: list[dict[str, Any]] = []
    for index, part in enumerate(robot.parts):
        entries.append(_part_entry(part, index, space))
        if index:
            siblings = entries[part.parent].setdefault("children", {})
            siblings[part.parent_slot] = entries[index]
    names = neuron_names(robot.brain, [entry["id"] for entry in entries])
    document = {
        "revolve_robot": VERSION,
        "body": entries[0],
        "brain": {
            "neurons": [
                {
                    "id": name,
                    "part": entries[neuron.part]["id"],
                    "layer": neuron.layer,
                    "type": neuron.kind,
                    "params": _named(kinds[neuron.kind], neuron.parameters),
                }
                for name, neuron in zip(names, robot.brain.neurons, strict=True)
                if neuron.layer != "input"
            ],
            "connections": [
                {
                    "source": names[edge.source],
                    "target": names[edge.target],
                    "weight": float(edge.weight),
                }
                for edge in robot.brain.connections
            ],
        },
    }
    return yaml.safe_dump(document, sort_keys=False, default_flow_style=None)


def _part_entry(part: Part, index: int, space: BodySpace) -> dict[str, Any]:
    entry = {} if index == 0 else {"slot": part.slot}
    return entry | {
        "id": f"part-{index}",
        "type": part.kind,
        "orientation": part.orientation,
        "gene": part.gene,
        "params": _named(space[part.kind].parameters, part.parameters),
    }


def _named(
    parameters: tuple[Parameter, ...], values: tuple[float, ...]
) -> dict[str, float]:
    pairs = zip(parameters, values, strict=True)
    return {parameter.name: float(value) for parameter, value in pairs}


class Reader:
    """Reader of one document.

    It keeps the line of everything that it reads, so that errors of checks on the
    complete robot name a line, too.

    Attributes:
        space: the allowed part types.
        parts: the parts read so far.
        part_index: their indices by name, in their order.
    """

    top_keys: tuple[str, ...] = ("revolve_robot", "body", "brain")
    edge_keys: tuple[str, str] = ("source", "target")
    part_keys: tuple[str, ...] = (
        "id", "type", "orientation", "gene", "params", "children",
    )  # fmt: skip

    def __init__(
        self, space: BodySpace, file: str, kinds: NeuronKinds = BUILT_IN_KINDS
    ) -> None:
        """Initialise for a document.

        Args:
            space: the allowed part types.
            file: name of the document, for messages.
            kinds: the allowed neuron types.
        """
        self.space = space
        self._kinds = kinds
        self._file = file
        self.parts: list[Part] = []
        self.part_index: dict[str, int] = {}
        self._lines: dict[str, int] = {}

    def read(self, document: Table) -> Robot:
        """Return the robot of a document.

        Raises:
            InvalidRobot: the document is wrong; the message names file, line and field.
        """
        document.refuse_others(*self.top_keys)
        if document.has("revolve_robot"):
            version = document.integer("revolve_robot")
            if version != VERSION:
                document.refuse(
                    "revolve_robot", f"must be {VERSION}, got {shown(version)}"
                )
        self._read_part(document.table("body"), -1, -1)
        brain = document.table("brain") if document.has("brain") else None
        robot = Robot(tuple(self.parts), self.brain(brain))
        try:
            check_number(robot)
            check_robot(robot, self.space, self._kinds)
        except InvalidRobot as error:
            raise InvalidRobot(f"{self._place(str(error))}: {error}") from None
        return robot

    def _place(self, message: str) -> str:
        """Return ``file:line`` of the field that a message of ``check_robot`` names."""
        found = _INDEXED.search(message)
        at = found.group() if found else ""
        line = self._lines.get(at) or self._lines.get(at.rpartition(".")[0])
        return self._file if line is None else f"{self._file}:{line}"

    def _read_part(self, table: Table, parent: int, parent_slot: int) -> None:
        index = len(self.parts)
        own = () if parent < 0 else ("slot",)
        table.refuse_others(*own, *self.part_keys)
        kind = self.space[self.kind(table)]
        name = table.text("id", f"part-{index}")
        if name in self.part_index:
            table.refuse("id", f"duplicate part name {shown(name)}")
        self.part_index[name] = index
        self._lines |= _lines(table, f"body.parts[{index}]")
        part = Part(
            kind=kind.name,
            parent=parent,
            parent_slot=parent_slot,
            slot=self.own_slot(table) if own else -1,
            orientation=self.orientation(table),
            parameters=_values(table, kind.parameters),
            gene=table.integer("gene", 0),
        )
        self.parts.append(part)
        if table.has("children"):
            children = table.table("children")
            for slot in sorted(map(children.key_as_slot, children.keys)):
                self._read_part(children.table(str(slot)), index, slot)

    def kind(self, table: Table) -> str:
        """Return the type of a part."""
        return table.word("type", self.space)

    def own_slot(self, table: Table) -> int:
        """Return the slot by which a part is attached to its parent."""
        return table.integer("slot")

    def orientation(self, table: Table) -> int:
        """Return the orientation of a part about the axis of its slot [degrees]."""
        return table.integer("orientation", 0)

    def weight(self, table: Table) -> float:
        """Return the weight of a connection."""
        return table.number("weight")

    def inputs(self) -> dict[str, Neuron]:
        """Return the input neurons of the sensors by name, in order."""
        return {
            f"{name}-in-{offset}": Neuron("input", INPUT, index)
            for name, index in self.part_index.items()
            for offset in range(self.space[self.parts[index].kind].inputs)
        }

    def brain(self, table: Table | None) -> Brain:
        """Return the brain, after the body was read; None is an omitted brain."""
        names = self.inputs()
        if table is None:
            return Brain(tuple(names.values()))
        table.refuse_others("neurons", "connections")
        written = [self._read_neuron(item) for item in table.tables("neurons")]
        written.sort(key=lambda entry: (LAYERS.index(entry[0].layer), entry[0].part))
        neurons = (*names.values(), *(neuron for neuron, _ in written))
        defaults = neuron_names(Brain(neurons), list(self.part_index))[len(names) :]
        for (neuron, item), default in zip(written, defaults, strict=True):
            self._lines |= _lines(item, f"brain.neurons[{len(names)}]")
            name = item.text("id", default)
            if name in names:
                item.refuse("id", f"duplicate neuron name {shown(name)}")
            names[name] = neuron
        return Brain(
            neurons, self.connections(table.tables("connections"), list(names))
        )

    def _read_neuron(self, table: Table) -> tuple[Neuron, Table]:
        table.refuse_others("id", "part", "layer", "type", "params")
        layer: Layer = (
            "output" if table.word("layer", _WRITTEN) == "output" else "hidden"
        )
        kind = table.word("type", self._kinds)
        part = self.part_index[table.word("part", self.part_index)]
        values = _values(table, self._kinds[kind])
        return Neuron(layer, kind, part, values), table

    def connections(
        self, tables: list[Table], names: list[str]
    ) -> tuple[Connection, ...]:
        """Return the connections, given the names of all neurons."""
        index = {name: number for number, name in enumerate(names)}
        edges = []
        for number, table in enumerate(tables):
            table.refuse_others(*self.edge_keys, "weight")
            self._lines |= table.lines(f"brain.connections[{number}]")
            source, target = (table.word(end, index) for end in self.edge_keys)
            edges.append(Connection(index[source], index[target], self.weight(table)))
        return tuple(edges)


def _lines(table: Table, name: str) -> dict[str, int]:
    """Return the lines of a mapping, of its keys and of its ``params``."""
    inner = table.table("params").lines(name) if table.has("params") else {}
    return inner | table.lines(name)


def _values(table: Table, parameters: tuple[Parameter, ...]) -> tuple[float, ...]:
    """Return the values of ``params`` in the order of the parameters."""
    if not table.has("params"):
        return tuple(parameter.default for parameter in parameters)
    params = table.table("params")
    params.refuse_others(*(parameter.name for parameter in parameters))
    return tuple(params.number(item.name, item.default) for item in parameters)
