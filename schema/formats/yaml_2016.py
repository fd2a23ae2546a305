"""Reader of the YAML form of Revolve (2016).

It differs from the current form in its defaults: a part is attached by its slot 0,
every output has a neuron, of type Simple unless ``params`` gives another, and hidden
neurons are a mapping by name. Connections go from ``src`` to ``dst``.

Source: the conversion of the published code (revolve/convert), and its examples.
"""

from schema.formats.yaml import Reader
from schema.formats.yaml_node import Table
from schema.robot.brain import NEURON_TYPES, Brain, Layer, Neuron

_KINDS = {"CoreComponent": "Core"}
_OTHER_NAMES = {"phase_offset": ("phaseOffset",), "amplitude": ("gain",)}
"""Older names of the parameters of oscillators in published robots."""
_ABOUT = ("id", "layer", "type", "part_id")


def is_of_revolve(document: Table) -> bool:
    """Return whether a document has keys that only the form of 2016 has."""
    if document.has("revolve_robot"):
        return False
    has_brain = not document.is_empty("brain")
    return document.has("id") or (has_brain and document.table("brain").has("params"))


class RevolveReader(Reader):
    """Reader of one document in the form of 2016; it ignores labels and numbers."""

    top_keys = ("id", "body", "brain")
    edge_keys = ("src", "dst")
    part_keys = ("id", "type", "orientation", "label", "params", "children")

    def kind(self, table: Table) -> str:
        """Return the type of a part by its name of 2016."""
        return table.word("type", self.space, _KINDS)

    def own_slot(self, table: Table) -> int:
        """Return the slot by which a part is attached to its parent; 0 by default."""
        return table.integer("slot", 0)

    def orientation(self, table: Table) -> int:
        """Return the orientation of a part; the form of 2016 writes 90.0."""
        degrees = table.number("orientation", 0.0)
        if not degrees.is_integer():
            table.refuse("orientation", f"must be a whole number, got {degrees}")
        return int(degrees)

    def weight(self, table: Table) -> float:
        """Return the weight of a connection; 0 by default."""
        return table.number("weight", 0.0)

    def brain(self, table: Table | None) -> Brain:
        """Return the brain: all outputs, and the hidden neurons of the document."""
        neurons = self.inputs()
        outputs = {
            f"{name}-out-{offset}": index
            for name, index in self.part_index.items()
            for offset in range(self.space[self.parts[index].kind].outputs)
        }
        if table is None:
            made = (_neuron("output", part, None) for part in outputs.values())
            return Brain((*neurons.values(), *made))
        table.refuse_others("neurons", "params", "connections")
        written, params = _tables(table, "neurons"), _tables(table, "params")
        known = {**neurons, **outputs, **written}
        for name in params:
            if name not in known:
                table.table("params").refuse(name, "unknown neuron")
        for name, part in outputs.items():
            entry = params.get(name) or written.get(name)
            neurons[name] = _neuron("output", part, entry)
        hidden = [name for name in written if name not in neurons]
        owner = {name: self._owner(written[name]) for name in hidden}
        for name in sorted(hidden, key=owner.__getitem__):
            entry = params.get(name) or written[name]
            neurons[name] = _neuron("hidden", owner[name], entry)
        edges = [] if table.is_empty("connections") else table.tables("connections")
        return Brain(tuple(neurons.values()), self.connections(edges, list(neurons)))

    def _owner(self, table: Table) -> int:
        """Return the part of a hidden neuron; the core by default."""
        if table.has("layer"):
            table.word("layer", ("hidden",))
        if table.is_empty("part_id"):
            return 0
        return self.part_index[table.word("part_id", self.part_index)]


def _tables(table: Table, key: str) -> dict[str, Table]:
    """Return the mappings in a mapping that may be missing or empty, by key."""
    if table.is_empty(key):
        return {}
    inner = table.table(key)
    return {name: inner.table(name) for name in inner.keys}


def _neuron(layer: Layer, part: int, table: Table | None) -> Neuron:
    """Return the neuron of a mapping; its type is Simple by default."""
    if table is None:
        defaults = (parameter.default for parameter in NEURON_TYPES["Simple"])
        return Neuron(layer, "Simple", part, tuple(defaults))
    kind = table.word("type", NEURON_TYPES) if table.has("type") else "Simple"
    values = []
    allowed = [*_ABOUT]
    for parameter in NEURON_TYPES[kind]:
        names = [parameter.name]
        if kind == "Oscillator":
            names += _OTHER_NAMES.get(parameter.name, ())
        allowed += names
        name = next((name for name in names if table.has(name)), parameter.name)
        values.append(table.number(name, parameter.default))
    table.refuse_others(*allowed)
    return Neuron(layer, kind, part, tuple(values))
