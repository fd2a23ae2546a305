"""Genome of a given robot: the inverse of development."""

from collections.abc import Sequence
from itertools import count

from msgspec.structs import replace

from schema.parts import BodySpace
from schema.robot.brain import Brain, Layer
from schema.robot.genome import (
    ConnectionGene,
    Genome,
    NeuronGene,
    assemble,
    develop,
    walk,
)
from schema.robot.robot import Part, Robot


def genome_of(robot: Robot) -> Genome:
    """Return a genome that develops into a robot.

    It develops into the same parts and neurons; connections are in the order of the
    parts that they leave.
    """
    neurons, places = _shares(robot.brain)
    connections: dict[int, list[ConnectionGene]] = {}
    for edge in robot.brain.connections:
        part, layer, offset = places[edge.source]
        end, end_layer, end_offset = places[edge.target]
        path = _path(part, end, robot.parts)
        target = (end_layer, end_offset)
        gene = ConnectionGene((layer, offset), path, target, edge.weight)
        connections.setdefault(part, []).append(gene)
    return assemble(
        robot.parts,
        lambda index: (
            tuple(neurons.get((index, "output"), ())),
            tuple(neurons.get((index, "hidden"), ())),
            tuple(connections.get(index, ())),
        ),
    )


def with_brain(genome: Genome, robot: Robot, space: BodySpace) -> Genome:
    """Return a genome with the parameters and weights of a brain.

    Connections that the robot does not have stay as they are.

    The robot is what develops from the genome, with other parameters and weights.
    """
    neurons, _ = _shares(robot.brain)
    own = [node.connections for node, _, _ in walk(genome)]

    def rebuilt(connections: Sequence[tuple[ConnectionGene, ...]]) -> Genome:
        return assemble(
            robot.parts,
            lambda index: (
                tuple(neurons.get((index, "output"), ())),
                tuple(neurons.get((index, "hidden"), ())),
                connections[index],
            ),
        )

    # Numbers in place of weights tell which gene a connection of the robot is from.
    numbers = count()
    numbered = [
        tuple(replace(gene, weight=float(next(numbers))) for gene in genes)
        for genes in own
    ]
    developed = develop(rebuilt(numbered), space).brain.connections
    learnt = {
        edge.weight: new.weight
        for edge, new in zip(developed, robot.brain.connections, strict=True)
    }
    return rebuilt(
        [
            tuple(
                replace(gene, weight=learnt.get(number.weight, gene.weight))
                for gene, number in zip(genes, marks, strict=True)
            )
            for genes, marks in zip(own, numbered, strict=True)
        ]
    )


Place = tuple[int, Layer, int]
"""Position of a neuron: part, layer, offset within part and layer."""


def _shares(
    brain: Brain,
) -> tuple[dict[tuple[int, Layer], list[NeuronGene]], list[Place]]:
    """Return the neurons of each part and layer, and the position of each neuron."""
    shares: dict[tuple[int, Layer], list[NeuronGene]] = {}
    places: list[Place] = []
    for neuron in brain.neurons:
        share = shares.setdefault((neuron.part, neuron.layer), [])
        places.append((neuron.part, neuron.layer, len(share)))
        share.append(NeuronGene(neuron.kind, neuron.parameters))
    return shares, places


def _path(start: int, end: int, parts: tuple[Part, ...]) -> tuple[int, ...]:
    """Return the slots to follow from one part to another."""
    up: list[int] = []
    down: list[int] = []
    # The greater index is never an ancestor of the smaller.
    while start != end:
        if start > end:
            up.append(parts[start].slot)
            start = parts[start].parent
        else:
            down.append(parts[end].parent_slot)
            end = parts[end].parent
    return (*up, *reversed(down))
