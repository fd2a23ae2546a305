"""A robot as something that can be handed down: the way back from development."""

from schema.brain import Layer
from schema.genome import ConnectionGene, Genome, NeuronGene, Node
from schema.robot import Part, Robot


def genome_of(robot: Robot) -> Genome:
    """Return a genome that develops into a robot.

    A robot that people made has none of its own; with this one it can mate.

    Args:
        robot: a well-formed robot.

    Returns:
        One node for each part, with its neurons and the connections that leave
        them. Development gives the robot back, its connections in the order of the
        parts that they leave.
    """
    owned = _owned(robot)
    children: list[list[tuple[int, Node]]] = [[] for _ in robot.parts]
    neurons = robot.brain.neurons
    places = {neuron: place for place, neuron in owned.items()}
    for index in range(len(robot.parts) - 1, -1, -1):
        part = robot.parts[index]
        genes = tuple(
            ConnectionGene(
                places[edge.source][1:],
                _path(robot.parts, index, neurons[edge.target].part),
                places[edge.target][1:],
                edge.weight,
            )
            for edge in robot.brain.connections
            if neurons[edge.source].part == index
        )
        node = Node(
            part.kind,
            part.slot,
            part.orientation,
            part.parameters,
            part.gene,
            _genes(robot, index, "output"),
            _genes(robot, index, "hidden"),
            genes,
            tuple(sorted(children[index], key=lambda child: child[0])),
        )
        if index:
            children[part.parent].append((part.parent_slot, node))
    return node


def _owned(robot: Robot) -> dict[tuple[int, Layer, int], int]:
    """Return the index of each neuron by part, layer and number within both."""
    counts: dict[tuple[int, Layer], int] = {}
    owned: dict[tuple[int, Layer, int], int] = {}
    for index, neuron in enumerate(robot.brain.neurons):
        key = (neuron.part, neuron.layer)
        owned[*key, counts.get(key, 0)] = index
        counts[key] = counts.get(key, 0) + 1
    return owned


def _genes(robot: Robot, part: int, layer: Layer) -> tuple[NeuronGene, ...]:
    return tuple(
        NeuronGene(neuron.kind, neuron.parameters)
        for neuron in robot.brain.neurons
        if (neuron.part, neuron.layer) == (part, layer)
    )


def _path(parts: tuple[Part, ...], start: int, end: int) -> tuple[int, ...]:
    """Return the slots that lead from a part to another through the tree."""
    up: list[int] = []
    down: list[int] = []
    # Parents come before their children: whoever comes later is not the meeting.
    while start != end:
        if start > end:
            up.append(parts[start].slot)
            start = parts[start].parent
        else:
            down.append(parts[end].parent_slot)
            end = parts[end].parent
    return (*up, *reversed(down))
