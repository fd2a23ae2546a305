"""Robots and genomes as Protobuf bytes, as robot files and tables hold them.

Rules that need the part types or neuron types are checked by
``schema.robot.robot.check_robot``.
"""

import math
from typing import TypeVar

from google.protobuf.message import DecodeError

from schema.errors import InvalidRobot, MalformedMessage
from schema.limits import MOST_CONNECTIONS, MOST_NEURONS, MOST_PARTS, ROBOT_BYTES
from schema.robot.brain import Brain, Connection, Layer, Neuron, check_brain
from schema.robot.genome import ConnectionGene, Genes, Genome, NeuronGene, assemble
from schema.robot.robot import Part, Robot, check_tree
from schema.wire import revolve_pb2 as pb

M = TypeVar("M", pb.Robot, pb.Genome)

LAYER_CODES: dict[Layer, pb.Layer] = {
    "input": pb.LAYER_INPUT,
    "output": pb.LAYER_OUTPUT,
    "hidden": pb.LAYER_HIDDEN,
}
_LAYERS: dict[int, Layer] = {int(code): name for name, code in LAYER_CODES.items()}


def encode_robot(robot: Robot) -> bytes:
    """Return the bytes of a robot; equal robots give equal bytes."""
    message = pb.Robot()
    add_part = message.parts.add
    for part in robot.parts:
        _write_part(part, add_part())
    add_neuron = message.neurons.add
    for neuron in robot.brain.neurons:
        item = add_neuron()
        item.layer = LAYER_CODES[neuron.layer]
        item.kind, item.part = neuron.kind, neuron.part
        if neuron.parameters:
            item.parameters.extend(neuron.parameters)
    add_connection = message.connections.add
    for edge in robot.brain.connections:
        entry = add_connection()
        entry.source, entry.target = edge.source, edge.target
        entry.weight = edge.weight
    return message.SerializeToString(deterministic=True)


def decode_robot(data: bytes) -> Robot:
    """Return the robot of some bytes.

    Raises:
        MalformedMessage: not a robot's bytes, parts that are not a tree, or a brain
            that breaks its rules.
    """
    message = _parsed(data, pb.Robot())
    _require_most(len(message.parts), MOST_PARTS, "Robot.parts")
    _require_most(len(message.neurons), MOST_NEURONS, "neurons")
    _require_most(len(message.connections), MOST_CONNECTIONS, "connections")
    # Of a list: one of an iterator is resized, and Python then keeps thousands of them.
    parts = tuple([_part_from_message(part) for part in message.parts])
    neurons = [
        Neuron(_layer(item.layer), item.kind, item.part, tuple(item.parameters[:]))
        for item in message.neurons
    ]
    connections = [
        Connection(item.source, item.target, item.weight)
        for item in message.connections
    ]
    robot = Robot(parts, Brain(tuple(neurons), tuple(connections)))
    try:
        check_tree(robot.parts)
        check_brain(robot.brain, len(robot.parts))
    except InvalidRobot as error:
        raise MalformedMessage(f"Robot: {error}") from None
    return robot


def decode_genome(data: bytes) -> Genome:
    """Return the genome of some bytes.

    Raises:
        MalformedMessage: not a genome's bytes, nodes that are not a tree, too many
            nodes, neurons or connections, an unknown layer, a number that is not
            finite.
    """
    nodes = _parsed(data, pb.Genome()).nodes
    _require_most(len(nodes), MOST_PARTS, "Genome.nodes")
    neurons = sum(len(node.outputs) + len(node.hidden) for node in nodes)
    _require_most(neurons, MOST_NEURONS, "neurons")
    edges = sum(len(node.connections) for node in nodes)
    _require_most(edges, MOST_CONNECTIONS, "connections")
    parts = tuple(_part_from_message(item.part) for item in nodes)
    try:
        check_tree(parts)
    except InvalidRobot as error:
        raise MalformedMessage(f"Genome: {error}") from None
    return assemble(parts, lambda index: _genes(nodes[index]))


def count_nodes(data: bytes) -> int:
    """Return the number of nodes of a genome.

    Raises:
        MalformedMessage: not a genome's bytes.
    """
    return len(_parsed(data, pb.Genome()).nodes)


def _genes(message: pb.Node) -> Genes:
    return (
        tuple(map(_neuron_gene, message.outputs)),
        tuple(map(_neuron_gene, message.hidden)),
        tuple(map(_connection_gene, message.connections)),
    )


def _write_part(part: Part, message: pb.Part) -> None:
    # Assignments are faster than keyword arguments by a quarter.
    message.kind = part.kind
    message.parent = part.parent
    message.parent_slot = part.parent_slot
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


def _neuron_gene(message: pb.NeuronGene) -> NeuronGene:
    parameters = tuple(message.parameters[:])
    if not all(map(math.isfinite, parameters)):
        raise MalformedMessage("neuron.parameters: must be finite")
    return NeuronGene(message.kind, parameters)


def _connection_gene(message: pb.ConnectionGene) -> ConnectionGene:
    if not math.isfinite(message.weight):
        raise MalformedMessage(
            f"connection.weight: must be finite, got {message.weight}"
        )
    return ConnectionGene(
        source=(_layer(message.source_layer), message.source_offset),
        path=tuple(message.path),
        target=(_layer(message.target_layer), message.target_offset),
        weight=message.weight,
    )


def _layer(code: int) -> Layer:
    if code not in _LAYERS:
        raise MalformedMessage(f"layer: must be one of {sorted(_LAYERS)}, got {code}")
    return _LAYERS[code]


def _parsed(data: bytes, message: M) -> M:
    """Return a message with the content of bytes, or raise ``MalformedMessage``."""
    name = message.DESCRIPTOR.name
    _require_most(len(data), ROBOT_BYTES, f"{name} in bytes")
    try:
        message.ParseFromString(data)
    except DecodeError as error:
        raise MalformedMessage(f"not the bytes of a {name}: {error}") from None
    return message


def _require_most(count: int, most: int, what: str) -> None:
    """Raise ``MalformedMessage`` if there are more than ``most`` of something."""
    if count > most:
        raise MalformedMessage(f"{what}: must be <= {most}, got {count}", "too large")
