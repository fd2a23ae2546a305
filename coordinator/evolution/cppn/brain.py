"""Development of a brain: neurons on the parts, connections where a network says so.

Each neuron has a place: the centre of its part, and a number that tells the neurons of
a part apart: -1, -2, ... for inputs, 1, 2, ... for outputs, 0 for a hidden neuron.
Source: Stanley, D'Ambrosio and Gauci, 2009, HyperNEAT; whether a connection exists is
an output of its own, as in Verbancsics and Stanley, 2011.
"""

from collections.abc import Sequence

import numpy as np

from coordinator.evolution.cppn.body import Grown, parameters_from, point
from coordinator.evolution.cppn.network import CppnGenome, evaluate, queries
from schema.robot.brain import INPUT, Brain, Connection, Neuron, NeuronKinds

HIDDEN, LINK, WEIGHT = "hidden", "link", "weight"


def brain_outputs(types: NeuronKinds) -> tuple[str, ...]:
    """Return the names of the outputs that describe a brain."""
    return (HIDDEN, LINK, WEIGHT, *_neuron_outputs(types))


def grow_brain(
    network: CppnGenome, parts: Sequence[Grown], max_hidden: int, types: NeuronKinds
) -> Brain:
    """Return the brain of a body.

    A neuron is queried with its place twice, a connection with the places of its
    neurons.

    Args:
        network: the genome.
        parts: of the body, in the order of the robot.
        max_hidden: greatest number of hidden neurons, at most one for each part.
        types: allowed types of neurons.
    """
    places = [point(part.position) for part in parts]
    neurons: list[Neuron] = []
    at: list[list[float]] = []
    for index, part in enumerate(parts):
        for number in range(part.kind.inputs):
            neurons.append(Neuron("input", INPUT, index))
            at.append([*places[index], -1.0 - number])
    hosts = [
        ("output", index, 1.0 + number)
        for index, part in enumerate(parts)
        for number in range(part.kind.outputs)
    ]
    hosts += [("hidden", index, 0.0) for index in range(len(parts))]
    own = np.array([[*places[index], number] for _, index, number in hosts])
    names = (HIDDEN, *_neuron_outputs(types))
    columns = evaluate(network, queries(own, own), names)
    hidden = 0
    for row, (layer, index, _) in enumerate(hosts):
        values = {name: float(column[row]) for name, column in columns.items()}
        if layer == "hidden":
            if values[HIDDEN] <= 0.0 or hidden == max_hidden:
                continue
            hidden += 1
        # Of equal values the first type wins.
        kind = max(types, key=lambda name: values[f"kind {name}"])
        parameters = parameters_from(values, types[kind], "neuron ")
        is_output = layer == "output"
        neurons.append(
            Neuron("output" if is_output else "hidden", kind, index, parameters)
        )
        at.append(own[row].tolist())
    return Brain(tuple(neurons), _connections(network, neurons, np.array(at)))


def _connections(
    network: CppnGenome, neurons: Sequence[Neuron], at: np.ndarray[tuple[int, int]]
) -> tuple[Connection, ...]:
    """Return the connections whose output ``link`` is above 0; places are (N, 4)."""
    targets = [i for i, neuron in enumerate(neurons) if neuron.layer != "input"]
    ends = [(source, target) for source in range(len(neurons)) for target in targets]
    if not ends:
        return ()
    sources, aims = np.array(ends).T
    found = evaluate(network, queries(at[sources], at[aims]), (LINK, WEIGHT))
    rows = zip(ends, found[LINK].tolist(), found[WEIGHT].tolist(), strict=True)
    return tuple(Connection(*pair, weight) for pair, link, weight in rows if link > 0.0)


def _neuron_outputs(types: NeuronKinds) -> tuple[str, ...]:
    parameters = {each.name: None for own in types.values() for each in own}
    return (
        *(f"kind {name}" for name in types),
        *(f"neuron {name}" for name in parameters),
    )
