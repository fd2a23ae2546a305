"""The encoding ``cppn``, a plug-in: networks develop into bodies and brains.

Each neuron has a place: the centre of its part, and a number that tells the neurons of
a part apart: -1, -2, ... for inputs, 1, 2, ... for outputs, 0 for a hidden neuron.
Source: Stanley, D'Ambrosio and Gauci, 2009, HyperNEAT; whether a connection exists is
an output of its own, as in Verbancsics and Stanley, 2011.
"""

from collections.abc import Sequence
from functools import lru_cache

import numpy as np

from coordinator.evolution.cppn import network as cppn
from coordinator.evolution.cppn import variation
from coordinator.evolution.cppn.body import (
    Grown,
    body_outputs,
    grow,
    parameters_from,
    parts_of,
    point,
)
from coordinator.evolution.cppn.network import CppnGenome, evaluate, queries
from schema.errors import ExperimentError
from schema.experiment.brains import neuron_kinds
from schema.experiment.document import Experiment
from schema.parts import BodySpace
from schema.robot.brain import INPUT, Brain, Connection, Neuron, NeuronKinds
from schema.robot.ids import BirthId
from schema.robot.robot import Robot

HIDDEN, LINK, WEIGHT = "hidden", "link", "weight"


def grow_brain(
    network: CppnGenome, parts: Sequence[Grown], max_hidden: int, types: NeuronKinds
) -> Brain:
    """Return the brain of a body, whose parts are in the order of the robot.

    A neuron is queried with its place twice, a connection with the places of its
    neurons. There is at most one hidden neuron for each part.
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


_MOST_TRIES = 10_000
"""Random networks without a viable robot before `Cppn.random` fails."""
_CACHED = 128


class Cppn:
    """Encoding by networks; a robot is viable with enough parts and a motor."""

    Parameters = variation.Parameters

    def __init__(
        self, experiment: Experiment, types: BodySpace, parameters: variation.Parameters
    ) -> None:
        self._space = experiment.space
        self._types = types
        self._rules = parameters
        self._neurons = neuron_kinds(experiment.brain, experiment.space)
        of_brains = (HIDDEN, LINK, WEIGHT, *_neuron_outputs(self._neurons))
        self._outputs = (*body_outputs(types), *of_brains)
        # The robot is asked for once by mutation and once by the run.
        self._developed = lru_cache(maxsize=_CACHED)(self._grown)

    def random(self, rng: np.random.Generator, _birth: BirthId) -> CppnGenome:
        """Return a random network with a viable robot.

        Raises:
            ExperimentError: there is (nearly) none.
        """
        for _ in range(_MOST_TRIES):
            network = variation.random_network(rng, self._outputs, self._rules)
            if self._is_viable(network):
                return network
        raise ExperimentError(
            f"encoding.type: 'cppn': {_MOST_TRIES} random networks gave no robot with "
            f"a motor and space.min_parts = {self._space.min_parts} parts"
        )

    def develop(self, genome: CppnGenome) -> Robot:
        """Return the robot that a network describes."""
        return self._developed(genome)

    def crossover(
        self, first: CppnGenome, second: CppnGenome, rng: np.random.Generator
    ) -> CppnGenome:
        """Return the first network with matching genes of either."""
        return variation.crossover(first, second, rng)

    def mutate(
        self, genome: CppnGenome, rng: np.random.Generator, _birth: BirthId
    ) -> CppnGenome | None:
        """Return a mutated network, None without a viable robot."""
        network = variation.mutate(genome, rng, self._outputs, self._rules)
        return network if self._is_viable(network) else None

    def to_bytes(self, genome: CppnGenome) -> bytes:
        """Return a network as bytes."""
        return cppn.to_bytes(genome)

    def from_bytes(self, data: bytes) -> CppnGenome:
        """Return the network of some bytes.

        Raises:
            ValueError: other bytes, or a network for another experiment.
        """
        return cppn.from_bytes(data, self._outputs)

    def _is_viable(self, network: CppnGenome) -> bool:
        robot = self.develop(network)
        has_motor = robot.brain.count("output") > 0
        return has_motor and len(robot.parts) >= self._space.min_parts

    def _grown(self, network: CppnGenome) -> Robot:
        grown = grow(network, self._space, self._types)
        parts, order = parts_of(grown[0])
        hidden = self._space.max_hidden
        return Robot(tuple(parts), grow_brain(network, order, hidden, self._neurons))
