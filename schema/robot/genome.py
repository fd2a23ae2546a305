"""Genomes, and their development into robots.

A genome is a tree of nodes. Each node owns the neurons of its part and the
connections that leave them. A connection gives its target by a path: the slots to
follow from the source node, to parents or children. Subtrees can therefore move
between genomes and keep their wiring. A path that cannot be followed is kept in the
genome and ignored in the robot.
"""

from collections.abc import Callable, Sequence

from msgspec import Struct

from schema.parts import BodySpace
from schema.robot.brain import INPUT, Brain, Connection, Layer, Neuron
from schema.robot.robot import Part, Robot


class NeuronGene(Struct, frozen=True, gc=False):
    """Output or hidden neuron: its type and parameters."""

    kind: str
    parameters: tuple[float, ...]


class ConnectionGene(Struct, frozen=True, gc=False):
    """Connection from a neuron of the node that owns it.

    Attributes:
        source: layer and offset within the owning node.
        path: slots to follow from the owning node; empty for the node itself.
        target: layer and offset within the node at the path's end.
        weight: of the state of the source.
    """

    source: tuple[Layer, int]
    path: tuple[int, ...]
    target: tuple[Layer, int]
    weight: float


class Node(Struct, frozen=True, gc=False):
    """Node of a genome: a part with its neurons and connections.

    Attributes:
        kind: name of the part type.
        slot: own slot by which it is attached; -1 for the root.
        orientation: rotation about the normal of its own slot [degrees].
        parameters: values in the order of the part type's ``parameters``.
        gene: identity that variation keeps; equal genes have a common origin.
        outputs: one neuron for each motor of the part.
        hidden: hidden neurons of the part.
        connections: from neurons of this node.
        children: (slot of this node, child), by ascending slot.
    """

    kind: str
    slot: int
    orientation: int
    parameters: tuple[float, ...]
    gene: int = 0
    outputs: tuple[NeuronGene, ...] = ()
    hidden: tuple[NeuronGene, ...] = ()
    connections: tuple[ConnectionGene, ...] = ()
    children: "tuple[tuple[int, Node], ...]" = ()


Genome = Node
"""A genome is its root node."""


def walk(genome: Genome) -> list[tuple[Node, int, int]]:
    """Return (node, index of its parent, slot of its parent), depth first.

    The core is first, with (-1, -1); children are by ascending slot, as are the parts
    of a robot.
    """
    entries: list[tuple[Node, int, int]] = []
    stack: list[tuple[Node, int, int]] = [(genome, -1, -1)]
    while stack:
        entry = stack.pop()
        if children := entry[0].children:
            index = len(entries)
            for slot, child in reversed(children):
                stack.append((child, index, slot))
        entries.append(entry)
    return entries


Genes = tuple[
    tuple[NeuronGene, ...], tuple[NeuronGene, ...], tuple[ConnectionGene, ...]
]
"""Outputs, hidden neurons and connections of a node."""


def assemble(parts: Sequence[Part], genes: Callable[[int], Genes]) -> Genome:
    """Return the genome of parts in depth-first order, given the genes of each."""
    children: list[list[tuple[int, Node]]] = [[] for _ in parts]
    # Backwards: children are made before their parent.
    for index in range(len(parts) - 1, -1, -1):
        part = parts[index]
        node = Node(
            part.kind,
            part.slot,
            part.orientation,
            part.parameters,
            part.gene,
            *genes(index),
            tuple(reversed(children[index])),
        )
        if index:
            children[part.parent].append((part.parent_slot, node))
    return node


def develop(genome: Genome, space: BodySpace) -> Robot:
    """Return the robot that a genome describes.

    Connections are left out if their path cannot be followed, if it ends at a missing
    neuron, or if an earlier connection has the same two neurons.
    """
    entries = walk(genome)
    inputs: list[Neuron] = []
    outputs: list[Neuron] = []
    hidden: list[Neuron] = []
    starts: list[tuple[int, int, int]] = []
    for index, (node, _, _) in enumerate(entries):
        starts.append((len(inputs), len(outputs), len(hidden)))
        if count := space[node.kind].inputs:
            inputs += [Neuron("input", INPUT, index)] * count
        if genes := node.outputs:
            outputs += [Neuron("output", g.kind, index, g.parameters) for g in genes]
        if genes := node.hidden:
            hidden += [Neuron("hidden", g.kind, index, g.parameters) for g in genes]
    starts.append((len(inputs), len(outputs), len(hidden)))
    parts = [
        Part(
            node.kind,
            parent,
            slot,
            node.slot,
            node.orientation,
            node.parameters,
            node.gene,
        )
        for node, parent, slot in entries
    ]
    edges = _edges(entries, starts)
    return Robot(tuple(parts), Brain((*inputs, *outputs, *hidden), edges))


def _edges(
    entries: list[tuple[Node, int, int]], starts: list[tuple[int, int, int]]
) -> tuple[Connection, ...]:
    """Return the connections of a genome, from ``walk``, whose neurons exist.

    ``starts`` are the numbers of inputs, outputs and hidden neurons before those of
    each node; the last entry has the totals.
    """
    inputs, outputs, _ = starts[-1]
    # Of each layer: its position in ``starts``, and its first index in the brain.
    layers: dict[Layer, tuple[int, int]] = {
        "input": (0, 0),
        "output": (1, inputs),
        "hidden": (2, inputs + outputs),
    }
    neighbours = neighbours_of(entries)
    edges: dict[tuple[int, int], Connection] = {}
    for index, (node, _, _) in enumerate(entries):
        for gene in node.connections:
            end = index
            for slot in gene.path:
                end = neighbours[end].get(slot, -1)
                if end < 0:
                    break
            kind, offset = gene.target
            if end < 0 or kind == "input":
                continue
            layer, begin = layers[kind]
            target = starts[end][layer] + offset
            if target >= starts[end + 1][layer]:
                continue
            target += begin
            kind, offset = gene.source
            layer, begin = layers[kind]
            source = starts[index][layer] + offset
            if source < starts[index + 1][layer]:
                source += begin
                if (source, target) not in edges:
                    edge = Connection(source, target, gene.weight)
                    edges[source, target] = edge
    return tuple(edges.values())


def neighbours_of(entries: list[tuple[Node, int, int]]) -> list[dict[int, int]]:
    """Return, for each node, the index of the neighbour at each used slot."""
    neighbours: list[dict[int, int]] = []
    for index, (node, parent, parent_slot) in enumerate(entries):
        neighbours.append({node.slot: parent})
        if index:
            neighbours[parent][parent_slot] = index
    return neighbours
