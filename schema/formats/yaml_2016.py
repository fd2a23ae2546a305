"""Reader of the YAML forms of Revolve, from 2015 to 2020.

They differ from the current form in their defaults: a part is attached by its slot 0,
every output has a neuron, of type Simple unless the brain gives another, neurons are a
mapping by name, and connections go from ``src`` to ``dst``. A file may hold a body
only. From 2018, a brain has a type, and its input and output neurons are listed under
names of their own, in the order of the part's inputs and outputs.

Source: the conversion of the published code (revolve/convert in ElteHupkes/revolve,
pyrevolve/revolve_bot in ci-group/revolve), and its examples.
"""

from schema.errors import shown
from schema.formats.document import Table
from schema.formats.yaml_reader import FULL_TURN, OTHER_TYPES, Reader
from schema.robot.brain import INPUT, LAYERS, NEURON_TYPES, Brain, Layer, Neuron

_KINDS = {"CoreComponent": "Core"}
_OTHER_NAMES = {"phase_offset": ("phaseOffset",), "amplitude": ("gain",)}
"""Older names of the parameters of oscillators in published robots."""
_ABOUT = ("id", "layer", "type", "part_id")
_NETWORK = "neural-network"
_End = tuple[Layer, int]
"""Layer of a neuron, and index of its part."""


def is_of_revolve(document: Table) -> bool:
    """Return whether a document has the form of the published Revolve."""
    if document.has("revolve_robot"):
        return False
    if document.is_null("brain") or document.has("id") or document.has("parents"):
        return True
    brain = document.table("brain")
    return brain.has("params") or brain.has("type") or brain.is_mapping("neurons")


class RevolveReader(Reader):
    """Reader of one document of Revolve; it ignores labels, numbers and ancestors."""

    top_keys = ("id", "parents", "body", "brain")
    edge_keys = ("src", "dst")
    part_keys = ("id", "type", "orientation", "label", "gene", "params", "children")

    def kind(self, table: Table) -> str:
        """Return the type of a part by its name in Revolve."""
        kind = _KINDS.get(table.text("type"))
        return kind or table.word("type", self.space, OTHER_TYPES)

    def orientation(self, table: Table) -> int:
        """Return the orientation of a part; Revolve also writes 90.0 and -90."""
        degrees = table.number("orientation", 0.0)
        if not degrees.is_integer():
            table.refuse("orientation", f"must be a whole number, got {degrees}")
        return int(degrees) % FULL_TURN

    def weight(self, table: Table) -> float:
        """Return the weight of a connection; 0 by default."""
        return table.number("weight", 0.0)

    def brain(self, table: Table | None) -> Brain:
        """Return the brain: all inputs and outputs, and the hidden neurons."""
        ends: dict[str, _End] = {}
        for name, index in self.part_index.items():
            own_type = self.space[self.parts[index].kind]
            inputs, outputs = range(own_type.inputs), range(own_type.outputs)
            ends |= {f"{name}-in-{k}": ("input", index) for k in inputs}
            ends |= {f"{name}-out-{k}": ("output", index) for k in outputs}
        if table is not None:
            if table.has("type") and (kind := table.text("type")) != _NETWORK:
                rule = f"must be {_NETWORK!r}; without the brain, the body can be read"
                table.refuse("type", f"{shown(kind)} is not supported: {rule}")
            table.refuse_others("type", "neurons", "params", "connections")
        written, params = _tables(table, "neurons"), _tables(table, "params")
        own, hidden = self._assigned(written, ends)
        named = [(own.get(name, name), *end) for name, end in ends.items()]
        named += [(name, "hidden", part) for name, part in hidden.items()]
        named.sort(key=lambda each: (LAYERS.index(each[1]), each[2]))
        neurons = {
            name: _neuron(layer, part, written.get(name), params.get(name))
            for name, layer, part in named
        }
        for name in params:
            if table is not None and name not in neurons:
                table.table("params").refuse(name, "unknown neuron")
        edges: list[Table] = []
        if table is not None and not table.is_empty("connections"):
            edges = table.tables("connections")
        return Brain(tuple(neurons.values()), self.connections(edges, neurons))

    def _assigned(
        self, written: dict[str, Table], ends: dict[str, _End]
    ) -> tuple[dict[str, str], dict[str, int]]:
        """Return names by default name of inputs and outputs, and hidden neurons."""
        free: dict[_End, list[str]] = {}
        for default, end in ends.items():
            if default not in written:
                free.setdefault(end, []).append(default)
        own: dict[str, str] = {}
        hidden: dict[str, int] = {}
        for name, table in written.items():
            end = self._end(table, ends.get(name, ("hidden", 0)))
            if end[0] == "hidden" and name not in ends:
                hidden[name] = end[1]
            elif ends.get(name) == end:
                own[name] = name
            elif name in ends or not free.get(end):
                part = shown(list(self.part_index)[end[1]])
                few = f"has {list(ends.values()).count(end)} {end[0]} neurons"
                table.refuse(
                    "layer", f"part {part} {few}, {shown(name)} is none of them"
                )
            else:
                own[free[end].pop(0)] = name
        return own, hidden

    def _end(self, table: Table, default: _End) -> _End:
        layer, part = default
        if table.has("layer"):
            word = table.word("layer", LAYERS)
            layer = next(each for each in LAYERS if each == word)
        if not table.is_empty("part_id"):
            part = self.part_index[table.word("part_id", self.part_index)]
        return layer, part


def _tables(table: Table | None, key: str) -> dict[str, Table]:
    """Return the mappings in a mapping that may be missing or empty, by key."""
    if table is None or table.is_empty(key):
        return {}
    inner = table.table(key)
    tables = {name: inner.table(name) for name in inner.keys}
    for name, each in tables.items():
        each.rename(f"neuron {shown(name)}")
    return tables


def _neuron(
    layer: Layer, part: int, written: Table | None, params: Table | None
) -> Neuron:
    """Return a neuron, of type Simple unless ``params`` or ``written`` has another."""
    tables = [each for each in (params, written) if each is not None]
    if params is not None and params.has("type"):
        tables = [params]
    typed = next((each for each in tables if each.has("type")), None)
    kind = INPUT if layer == "input" else "Simple"
    types = {INPUT: ()} if layer == "input" else NEURON_TYPES
    if typed is not None:
        kind = typed.word("type", types)
    values = []
    allowed = [*_ABOUT]
    for parameter in types[kind]:
        names = [parameter.name]
        if kind == "Oscillator":
            names += _OTHER_NAMES.get(parameter.name, ())
        allowed += names
        given = ((each, name) for each in tables for name in names if each.has(name))
        table, name = next(given, (None, ""))
        values.append(parameter.default if table is None else table.number(name))
    for each in tables:
        each.refuse_others(*allowed)
    return Neuron(layer, kind, part, tuple(values))
