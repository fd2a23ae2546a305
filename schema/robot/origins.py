"""Names of what brains have in common: by the origin of parts, or by shared roles."""

from collections import Counter
from collections.abc import Iterable

from schema.robot.brain import Layer
from schema.robot.modular import Role, place_of
from schema.robot.robot import Robot

Name = tuple[int, int, Layer, str, int]
"""Name of a neuron.

The gene of its part, the number of that gene in the body (some parts are copies), the
layer, its type, and its number among those of this layer and type in the part. All
inputs have the type ``""``.
"""


def part_names(genes: Iterable[int]) -> list[tuple[int, int]]:
    """Return the gene of each part, and the number of that gene so far."""
    seen: Counter[int] = Counter()
    names: list[tuple[int, int]] = []
    for gene in genes:
        names.append((gene, seen[gene]))
        seen[gene] += 1
    return names


def names_of(robot: Robot) -> tuple[list[Name], list[tuple[Name, Name]]]:
    """Return the names of a robot's neurons, and of its connections: pairs of ends."""
    parts = part_names(part.gene for part in robot.parts)
    counts: Counter[tuple[int, Layer, str]] = Counter()
    names: list[Name] = []
    for each in robot.brain.neurons:
        kind = "" if each.layer == "input" else each.kind
        own = each.part, each.layer, kind
        names.append((*parts[each.part], each.layer, kind, counts[own]))
        counts[own] += 1
    edges = robot.brain.connections
    return names, [(names[edge.source], names[edge.target]) for edge in edges]


def roles_of(robot: Robot) -> tuple[list[int], list[Role]]:
    """Return the places of a ``modular`` brain's neurons, and roles of connections.

    Neurons of one place have one bias, connections of one role one weight.
    """
    counts: Counter[tuple[int, Layer]] = Counter()
    places: list[int] = []
    for neuron in robot.brain.neurons:
        own = neuron.part, neuron.layer
        places.append(place_of(neuron.layer, counts[own]))
        counts[own] += 1
    roles: list[Role] = []
    for edge in robot.brain.connections:
        source = robot.brain.neurons[edge.source]
        start, end = source.part, robot.brain.neurons[edge.target].part
        layer, relation = "state", "own"
        if source.layer == "input":
            layer, relation = "input", robot.parts[start].kind
        elif start != end:
            relation = "parent" if robot.parts[end].parent == start else "child"
        roles.append((layer, relation, places[edge.source], places[edge.target]))
    return places, roles
