"""Conversion of robots and genomes to Protobuf messages and back.

``schema.wire.codec`` encodes the messages.
"""

import math
from collections.abc import Sequence

from schema.errors import InvalidRobot, MalformedMessage
from schema.experiment.identity import Identity, Origin
from schema.limits import LONGEST_WALL_S, MOST_CONNECTIONS, MOST_NEURONS, MOST_PARTS
from schema.parts import Vector
from schema.robot.brain import Brain, Connection, Layer, Neuron, check_brain
from schema.robot.genome import (
    ConnectionGene,
    Genes,
    Genome,
    NeuronGene,
    Node,
    assemble,
    walk,
)
from schema.robot.ids import BirthId
from schema.robot.robot import Part, Robot, check_tree
from schema.wire import revolve_pb2 as pb
from schema.wire.decoding import require_most

_LAYER_CODES: dict[Layer, pb.Layer] = {
    "input": pb.LAYER_INPUT,
    "output": pb.LAYER_OUTPUT,
    "hidden": pb.LAYER_HIDDEN,
}
_LAYERS: dict[int, Layer] = {int(code): name for name, code in _LAYER_CODES.items()}


def robot_to_message(robot: Robot) -> pb.Robot:
    """Return a robot as a message."""
    message = body_to_message(robot.parts)
    write_brain(robot.brain, message)
    return message


def body_to_message(parts: Sequence[Part]) -> pb.Robot:
    """Return a body as the message of a robot without a brain."""
    message = pb.Robot()
    add_part = message.parts.add
    for part in parts:
        _write_part(part, part.parent, part.parent_slot, add_part())
    return message


def robot_from_message(message: pb.Robot) -> Robot:
    """Return the robot of a message.

    Raises:
        MalformedMessage: parts that are not a tree, a brain that breaks its rules, an
            unknown layer.
    """
    parts = body_from_message(message)
    return Robot(parts, read_brain(message, len(parts)))


def body_from_message(message: pb.Robot) -> tuple[Part, ...]:
    """Return the body of a message; its brain is not read.

    Raises:
        MalformedMessage: parts that are not a tree, or too many.
    """
    require_most(len(message.parts), MOST_PARTS, "Robot.parts")
    # Of a list: one of an iterator is resized, and Python then keeps thousands of them.
    parts = tuple([_part_from_message(part) for part in message.parts])
    _require_tree(parts, "Robot")
    return parts


def write_brain(brain: Brain, message: pb.Robot | pb.BrainChange) -> None:
    """Add a brain to a message that has neurons and connections."""
    add_neuron = message.neurons.add
    for neuron in brain.neurons:
        item = add_neuron()
        item.layer = _LAYER_CODES[neuron.layer]
        item.kind, item.part = neuron.kind, neuron.part
        if neuron.parameters:
            item.parameters.extend(neuron.parameters)
    add_connection = message.connections.add
    for edge in brain.connections:
        entry = add_connection()
        entry.source, entry.target = edge.source, edge.target
        entry.weight = edge.weight


def read_brain(message: pb.Robot | pb.BrainChange, part_count: int) -> Brain:
    """Return the brain of a message that has neurons and connections.

    Raises:
        MalformedMessage: a brain that breaks its rules or is too large, or an unknown
            layer.
    """
    require_most(len(message.neurons), MOST_NEURONS, "neurons")
    require_most(len(message.connections), MOST_CONNECTIONS, "connections")
    brain = Brain(
        neurons=tuple(
            [
                Neuron(
                    _layer(item.layer), item.kind, item.part, tuple(item.parameters[:])
                )
                for item in message.neurons
            ]
        ),
        connections=tuple(
            [
                Connection(item.source, item.target, item.weight)
                for item in message.connections
            ]
        ),
    )
    try:
        check_brain(brain, part_count)
    except InvalidRobot as error:
        raise MalformedMessage(f"Robot: {error}") from None
    return brain


def genome_to_message(genome: Genome) -> pb.Genome:
    """Return a genome as a message."""
    message = pb.Genome()
    for node, parent, parent_slot in walk(genome):
        entry = message.nodes.add()
        _write_part(node, parent, parent_slot, entry.part)
        # Access to empty fields takes time, too.
        for gene in node.outputs:
            neuron = entry.outputs.add()
            neuron.kind = gene.kind
            neuron.parameters.extend(gene.parameters)
        for gene in node.hidden:
            neuron = entry.hidden.add()
            neuron.kind = gene.kind
            neuron.parameters.extend(gene.parameters)
        if node.connections:
            _write_connections(node.connections, entry)
    return message


def _write_connections(connections: tuple[ConnectionGene, ...], node: pb.Node) -> None:
    add = node.connections.add
    for edge in connections:
        entry = add()
        layer, offset = edge.source
        entry.source_layer, entry.source_offset = _LAYER_CODES[layer], offset
        if edge.path:
            entry.path.extend(edge.path)
        layer, offset = edge.target
        entry.target_layer, entry.target_offset = _LAYER_CODES[layer], offset
        entry.weight = edge.weight


def genome_from_message(message: pb.Genome) -> Genome:
    """Return the genome of a message.

    Raises:
        MalformedMessage: nodes that are not a tree, too many nodes, neurons or
            connections, an unknown layer, a number that is not finite.
    """
    nodes = message.nodes
    require_most(len(nodes), MOST_PARTS, "Genome.nodes")
    neurons = sum(len(node.outputs) + len(node.hidden) for node in nodes)
    require_most(neurons, MOST_NEURONS, "neurons")
    edges = sum(len(node.connections) for node in nodes)
    require_most(edges, MOST_CONNECTIONS, "connections")
    parts = tuple(_part_from_message(item.part) for item in message.nodes)
    _require_tree(parts, "Genome")
    return assemble(parts, lambda index: _genes(message.nodes[index]))


def _genes(message: pb.Node) -> Genes:
    return (
        tuple(map(_neuron_gene, message.outputs)),
        tuple(map(_neuron_gene, message.hidden)),
        tuple(map(_connection_gene, message.connections)),
    )


def birth_to_message(birth: BirthId) -> pb.BirthName:
    """Return the id of an individual as a message."""
    return pb.BirthName(island=birth.island, number=birth.number)


def birth_from_message(message: pb.BirthName) -> BirthId:
    """Return the id of an individual of a message."""
    return BirthId(message.island, message.number)


def identity_to_message(identity: Identity) -> pb.Identity:
    """Return the identity of an evaluation as a message."""
    origin = identity.origin
    return pb.Identity(
        seed=origin.seed,
        run=origin.run,
        island=origin.island,
        birth=birth_to_message(identity.birth),
        trial=identity.trial,
    )


def identity_from_message(message: pb.Identity) -> Identity:
    """Return the identity of a message; an empty one gives ``NO_IDENTITY``."""
    return Identity(
        Origin(seed=message.seed, run=message.run, island=message.island),
        birth_from_message(message.birth),
        message.trial,
    )


def _write_part(
    part: Part | Node, parent: int, parent_slot: int, message: pb.Part
) -> None:
    # Assignments are faster than keyword arguments by a quarter.
    message.kind = part.kind
    message.parent = parent
    message.parent_slot = parent_slot
    message.slot = part.slot
    message.orientation = part.orientation
    message.parameters.extend(part.parameters)
    message.gene = part.gene


def _part_from_message(message: pb.Part) -> Part:
    return Part(
        message.kind,
        message.parent,
        message.parent_slot,
        message.slot,
        message.orientation,
        tuple(message.parameters[:]),
        message.gene,
    )


def _require_tree(parts: Sequence[Part], name: str) -> None:
    """Raise unless parts are a tree.

    Raises:
        MalformedMessage: they are not; begins with the name of the message.
    """
    try:
        check_tree(parts)
    except InvalidRobot as error:
        raise MalformedMessage(f"{name}: {error}") from None


def _neuron_gene(message: pb.NeuronGene) -> NeuronGene:
    parameters = tuple(message.parameters[:])
    if not all(map(math.isfinite, parameters)):
        raise MalformedMessage("neuron.parameters: must be finite")
    return NeuronGene(message.kind, parameters)


def _connection_gene(message: pb.ConnectionGene) -> ConnectionGene:
    return ConnectionGene(
        source=(_layer(message.source_layer), message.source_offset),
        path=tuple(message.path),
        target=(_layer(message.target_layer), message.target_offset),
        weight=finite(message.weight, "connection.weight"),
    )


def _layer(code: int) -> Layer:
    if code not in _LAYERS:
        raise MalformedMessage(f"layer: must be one of {sorted(_LAYERS)}, got {code}")
    return _LAYERS[code]


def finite(value: float, where: str) -> float:
    """Return a number of a message.

    Raises:
        MalformedMessage: it is not finite.
    """
    if not math.isfinite(value):
        raise MalformedMessage(f"{where}: must be finite, got {value}")
    return value


def vector_to_message(vector: Vector) -> pb.Vector:
    """Return a vector as a message."""
    return pb.Vector(x=vector[0], y=vector[1], z=vector[2])


def vector_from_message(message: pb.Vector, where: str) -> Vector:
    """Return the vector of a message.

    Raises:
        MalformedMessage: a number that is not finite.
    """
    x, y, z = message.x, message.y, message.z
    return finite(x, where), finite(y, where), finite(z, where)


def read_wall_s(message: pb.Answer | pb.AdvanceAnswer) -> float:
    """Return the duration of an answer [s].

    Raises:
        MalformedMessage: it is negative, too long or not a number.
    """
    wall_s = message.wall_s
    if not 0.0 <= wall_s <= LONGEST_WALL_S:
        raise MalformedMessage(
            f"answer.wall_s: must be in [0, {LONGEST_WALL_S:g}], got {wall_s}"
        )
    return wall_s
