"""The genome that evolution varies, and its development into a robot.

A genome is a tree of nodes. Each node owns the neurons of its part and the
connections that leave them. A connection names its target by a path: the slots
to follow from the source node, towards parent or child alike. Subtrees can
therefore move between genomes and keep their wiring; a path that leads nowhere
in the new place is kept, and ignored in the robot.
"""

from msgspec import Struct

from schema.parts import BodySpace
from schema.robot.brain import INPUT, Brain, Connection, Layer, Neuron
from schema.robot.robot import Part, Robot


class NeuronGene(Struct, frozen=True, gc=False):
    """An output or hidden neuron: its type and that type's parameters."""

    kind: str
    parameters: tuple[float, ...]


class ConnectionGene(Struct, frozen=True, gc=False):
    """A connection that leaves a neuron of the node that owns it.

    Attributes:
        source: layer and offset within the owning node.
        path: slots to follow from the owning node; empty is the node itself.
        target: layer and offset within the node at the path's end.
        weight: factor of the source's state.
    """

    source: tuple[Layer, int]
    path: tuple[int, ...]
    target: tuple[Layer, int]
    weight: float


class Node(Struct, frozen=True, gc=False):
    """One gene of a genome: a part with its share of the brain.

    Attributes:
        kind: name of the part type.
        slot: own slot that joins it to its parent; -1 for the root.
        orientation: turn about its own slot's normal [degrees].
        parameters: values in the order of the part type's ``parameters``.
        gene: identity that outlives variation; equal genes share an origin.
        outputs: one neuron for each motor of the part.
        hidden: hidden neurons that live on this part.
        connections: those whose source is a neuron of this node.
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

    The core comes first, with (-1, -1); children by ascending slot, as the parts
    of a robot stand.
    """
    entries: list[tuple[Node, int, int]] = []
    stack: list[tuple[Node, int, int]] = [(genome, -1, -1)]
    while stack:
        entry = stack.pop()
        index = len(entries)
        entries.append(entry)
        if entry[0].children:
            stack += [
                (child, index, slot) for slot, child in reversed(entry[0].children)
            ]
    return entries


def develop(genome: Genome, space: BodySpace) -> Robot:
    """Return the robot that a genome describes.

    Paths that cannot be followed or that end at a missing neuron are left out,
    and so is every connection after the first between the same two neurons.

    Args:
        genome: a well-formed genome of this body space.
        space: its part types.

    Returns:
        The robot: parts in depth-first order, neurons by layer and then by part.
    """
    entries = walk(genome)
    parts: list[Part] = []
    inputs: list[Neuron] = []
    outputs: list[Neuron] = []
    hidden: list[Neuron] = []
    starts: list[tuple[int, int, int]] = []
    for index, (node, parent, slot) in enumerate(entries):
        parts.append(
            Part(
                node.kind,
                parent,
                slot,
                node.slot,
                node.orientation,
                node.parameters,
                node.gene,
            )
        )
        starts.append((len(inputs), len(outputs), len(hidden)))
        if count := space[node.kind].inputs:
            inputs += [Neuron("input", INPUT, index)] * count
        outputs += [
            Neuron("output", gene.kind, index, gene.parameters) for gene in node.outputs
        ]
        hidden += [
            Neuron("hidden", gene.kind, index, gene.parameters) for gene in node.hidden
        ]
    starts.append((len(inputs), len(outputs), len(hidden)))
    edges = _edges(entries, starts)
    return Robot(tuple(parts), Brain((*inputs, *outputs, *hidden), edges))


def _edges(
    entries: list[tuple[Node, int, int]], starts: list[tuple[int, int, int]]
) -> tuple[Connection, ...]:
    """Return the connections of a genome that lead from a neuron to a neuron.

    Args:
        entries: its nodes, as ``walk`` gives them.
        starts: how many inputs, outputs and hidden neurons stand before those of
            each node; how many there are, at the end.
    """
    inputs, outputs, _ = starts[-1]
    # Of each layer: its place in ``starts``, and where it begins in the brain.
    layers: dict[Layer, tuple[int, int]] = {
        "input": (0, 0),
        "output": (1, inputs),
        "hidden": (2, inputs + outputs),
    }
    neighbours = _neighbours(entries)
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
            ends = begin + target
            kind, offset = gene.source
            layer, begin = layers[kind]
            source = starts[index][layer] + offset
            if source < starts[index + 1][layer]:
                key = (begin + source, ends)
                if key not in edges:
                    edges[key] = Connection(*key, gene.weight)
    return tuple(edges.values())


def _neighbours(entries: list[tuple[Node, int, int]]) -> list[dict[int, int]]:
    """Return, for each node, the node that each of its used slots leads to."""
    neighbours: list[dict[int, int]] = [{} for _ in entries]
    for index, (node, parent, parent_slot) in enumerate(entries):
        if parent >= 0:
            neighbours[index][node.slot] = parent
            neighbours[parent][parent_slot] = index
    return neighbours
