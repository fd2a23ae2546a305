"""Brains of the births table, with neurons named by the origin of their parts."""

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import pyarrow as pa

from schema.robot.brain import Layer
from schema.robot.genome import Genome, neighbours_of, walk
from schema.robot.origins import Name, names_of, part_names
from schema.robot.robot import Robot
from schema.wire.protobuf import decode_genome, decode_robot

Place = tuple[int, Layer, int]
"""Index of a neuron's part, its layer, and its number in that layer of the part."""


@dataclass(frozen=True, slots=True)
class Controller:
    """Network of a robot by the names of its neurons.

    Attributes:
        neurons: parameters of output and hidden neurons.
        edges: weights by source and target, where both neurons exist.
        has_origin: all parts have a gene.
    """

    neurons: Mapping[Name, tuple[float, ...]]
    edges: Mapping[tuple[Name, Name], float]
    has_origin: bool


def controllers(births: pa.Table) -> Iterator[Controller | None]:
    """Yield the brain of each birth; None if the table does not have it.

    Raises:
        MalformedMessage: damaged bytes, or no robot beside a genome of another encoding
            than ``revolve-angle``, as in earlier runs.
    """
    columns = (births[name].to_pylist() for name in ("genome", "robot"))
    for genome, robot in zip(*columns, strict=True):
        if robot is not None:
            yield of_robot(decode_robot(robot))
        elif genome:
            yield of_genome(decode_genome(genome))
        else:
            yield None


def of_genome(genome: Genome) -> Controller:
    """Return the network of a genome of ``revolve-angle``.

    As in development, a connection whose path or target does not exist is left out,
    and so is a second one between the same neurons.
    """
    entries = walk(genome)
    neighbours = neighbours_of(entries)
    neurons: dict[Place, tuple[str, tuple[float, ...]]] = {}
    edges: dict[tuple[Place, Place], float] = {}
    for index, (node, _, _) in enumerate(entries):
        for number, gene in enumerate(node.outputs):
            neurons[index, "output", number] = gene.kind, gene.parameters
        for number, gene in enumerate(node.hidden):
            neurons[index, "hidden", number] = gene.kind, gene.parameters
        for edge in node.connections:
            end = index
            for slot in edge.path:
                end = neighbours[end].get(slot, -1)
                if end < 0:
                    break
            if end >= 0:
                edges.setdefault(
                    ((index, *edge.source), (end, *edge.target)), edge.weight
                )
    return _named([node.gene for node, _, _ in entries], neurons, edges)


def _named(
    genes: Sequence[int],
    neurons: Mapping[Place, tuple[str, tuple[float, ...]]],
    edges: Mapping[tuple[Place, Place], float],
) -> Controller:
    """Return a network by names; edges without one of their neurons are left out."""
    copies = part_names(genes)
    counts: Counter[tuple[int, Layer, str]] = Counter()
    names: dict[Place, Name] = {}
    for place, (kind, _) in neurons.items():
        part, layer, _ = place
        names[place] = *copies[part], layer, kind, counts[part, layer, kind]
        counts[part, layer, kind] += 1

    def name(place: Place) -> Name | None:
        part, layer, number = place
        if layer == "input":
            return *copies[part], layer, "", number
        return names.get(place)

    weights: dict[tuple[Name, Name], float] = {}
    for (start, end), weight in edges.items():
        source, target = name(start), names.get(end)
        if source is not None and target is not None:
            weights[source, target] = weight
    parameters = {names[place]: values for place, (_, values) in neurons.items()}
    return Controller(parameters, weights, all(genes))


def of_robot(robot: Robot) -> Controller:
    """Return the network of a robot."""
    names, ends = names_of(robot)
    brain = robot.brain
    neurons = {
        name: neuron.parameters
        for name, neuron in zip(names, brain.neurons, strict=True)
        if neuron.layer != "input"
    }
    weights = (edge.weight for edge in brain.connections)
    has_origin = all(part.gene for part in robot.parts)
    return Controller(neurons, dict(zip(ends, weights, strict=True)), has_origin)
