"""Reader of robots as YAML: the current form, which ``schema.formats.yaml`` describes.

Messages name the ids of the file, its name and line.
"""

import re
from collections.abc import Sequence

from schema.errors import InvalidRobot, shown
from schema.formats.document import Table
from schema.formats.yaml import VERSION
from schema.parts import BodySpace, Parameter
from schema.robot.brain import (
    INPUT,
    LAYERS,
    Brain,
    Connection,
    Neuron,
    NeuronKinds,
    neuron_names,
)
from schema.robot.cpg import BUILT_IN_KINDS
from schema.robot.robot import Part, Robot, check_number, check_robot

FULL_TURN = 360
OTHER_TYPES = " (name the experiment with its part types: --experiment FILE.toml)"
"""End of the message about an unknown part type."""
_FIELD = re.compile(r"(?:body\.parts|brain\.(?:neurons|connections))\[\d+\](\.\w+)?")
_INDEXED = re.compile(r"(body\.parts|brain\.neurons|brain\.connections)\[(\d+)\](\.?)")
_WORDS = {"body.parts": "part", "brain.neurons": "neuron", "brain.connections": ""}


class Reader:
    """Reader of one document.

    It keeps the line of everything that it reads, so that errors of checks on the
    complete robot name a line, too.

    Attributes:
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
        self.space = space
        self._kinds = kinds
        self._file = file
        self.parts: list[Part] = []
        self.part_index: dict[str, int] = {}
        self._neurons: list[str] = []
        self._edges: list[tuple[str, str]] = []
        self._lines: dict[str, int] = {}

    def read(self, document: Table) -> Robot:
        """Return the robot of a document; errors name file, line and field."""
        document.refuse_others(*self.top_keys)
        if document.has("revolve_robot"):
            version = document.integer("revolve_robot")
            if version != VERSION:
                rule = f"must be {VERSION}, got {shown(version)}"
                document.refuse("revolve_robot", rule)
        self._read_part(document.table("body"), -1, -1)
        brain = None if document.is_null("brain") else document.table("brain")
        robot = Robot(tuple(self.parts), self.brain(brain))
        try:
            check_number(robot)
            check_robot(robot, self.space, self._kinds)
        except InvalidRobot as error:
            parts, message = list(self.part_index), str(error)
            named = with_ids(message, parts, self._neurons, self._edges)
            raise InvalidRobot(f"{self._place(message)}: {named}") from None
        return robot

    def _place(self, message: str) -> str:
        """Return ``file:line`` of the field that a message of ``check_robot`` names."""
        found = _FIELD.search(message)
        at = found.group() if found else ""
        line = self._lines.get(at) or self._lines.get(at.rpartition(".")[0])
        return self._file if line is None else f"{self._file}:{line}"

    def _read_part(self, table: Table, parent: int, parent_slot: int) -> None:
        index = len(self.parts)
        own = () if parent < 0 else ("slot",)
        name = table.text("id", f"part-{index}")
        if table.has("id"):
            table.rename(f"part {shown(name)}")
        table.refuse_others(*own, *self.part_keys)
        kind = self.space[self.kind(table)]
        if name in self.part_index:
            table.refuse("id", f"duplicate part name {shown(name)}")
        self.part_index[name] = index
        self._lines |= _lines(table, f"body.parts[{index}]")
        part = Part(
            kind=kind.name,
            parent=parent,
            parent_slot=parent_slot,
            slot=table.integer("slot", 0) if own else -1,
            orientation=self.orientation(table),
            parameters=_values(table, kind.parameters),
            gene=table.integer("gene", 0),
        )
        self.parts.append(part)
        if not table.is_null("children"):
            children = table.table("children")
            for slot in sorted(map(children.key_as_slot, children.keys)):
                self._read_part(children.table(str(slot)), index, slot)

    def kind(self, table: Table) -> str:
        """Return the type of a part."""
        return table.word("type", self.space, OTHER_TYPES)

    def orientation(self, table: Table) -> int:
        """Return the orientation of a part about the axis of its slot [degrees]."""
        return table.integer("orientation", 0) % FULL_TURN

    def weight(self, table: Table) -> float:
        """Return the weight of a connection."""
        return table.number("weight")

    def brain(self, table: Table | None) -> Brain:
        """Return the brain, after the body was read; None is an omitted brain."""
        names = {
            f"{name}-in-{offset}": Neuron("input", INPUT, index)
            for name, index in self.part_index.items()
            for offset in range(self.space[self.parts[index].kind].inputs)
        }
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
        self._check_outputs(table, neurons)
        return Brain(neurons, self.connections(table.tables("connections"), names))

    def _check_outputs(self, table: Table, neurons: tuple[Neuron, ...]) -> None:
        """Raise unless each part has the output neurons of its motor."""
        owners = [neuron.part for neuron in neurons if neuron.layer == "output"]
        for name, index in self.part_index.items():
            expected = self.space[self.parts[index].kind].outputs
            if (count := owners.count(index)) != expected:
                rule = f"must have {expected} output neurons, got {count}"
                table.refuse("neurons", f"part {shown(name)} {rule}")

    def _read_neuron(self, table: Table) -> tuple[Neuron, Table]:
        if table.has("id"):
            table.rename(f"neuron {shown(table.text('id'))}")
        table.refuse_others("id", "part", "layer", "type", "params")
        is_output = table.word("layer", ("output", "hidden")) == "output"
        kind = table.word("type", self._kinds)
        part = self.part_index[table.word("part", self.part_index)]
        values = _values(table, self._kinds[kind])
        return Neuron("output" if is_output else "hidden", kind, part, values), table

    def connections(
        self, tables: list[Table], neurons: dict[str, Neuron]
    ) -> tuple[Connection, ...]:
        """Return the connections, given all neurons by name."""
        index = {name: number for number, name in enumerate(neurons)}
        self._neurons = list(neurons)
        edges: list[Connection] = []
        for number, table in enumerate(tables):
            table.refuse_others(*self.edge_keys, "weight")
            self._lines |= table.lines(f"brain.connections[{number}]")
            source, target = (table.word(end, index) for end in self.edge_keys)
            self._edges.append((source, target))
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


def with_ids(
    message: str,
    parts: Sequence[str],
    neurons: Sequence[str],
    connections: Sequence[tuple[str, str]],
) -> str:
    """Return a message of ``check_robot`` with ids in place of indices.

    ``body.parts[2].slot: ...`` becomes ``part 'leg': slot: ...``.
    """
    ids = {
        "body.parts": [shown(name) for name in parts],
        "brain.neurons": [shown(name) for name in neurons],
        "brain.connections": [
            f"connection {shown(source)} -> {shown(target)}"
            for source, target in connections
        ],
    }

    def named(found: re.Match[str]) -> str:
        kind, index, dot = found[1], int(found[2]), found[3]
        if index >= len(ids[kind]):
            return found[0]
        stem = f"{_WORDS[kind]} {ids[kind][index]}".strip()
        return f"{stem}: " if dot else stem

    return _INDEXED.sub(named, message)
