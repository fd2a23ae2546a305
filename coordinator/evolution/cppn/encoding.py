"""The encoding ``cppn``, a plug-in: networks develop into bodies and brains."""

from functools import lru_cache

import numpy as np

from coordinator.evolution.cppn import network as cppn
from coordinator.evolution.cppn import variation
from coordinator.evolution.cppn.body import body_outputs, grow, parts_of
from coordinator.evolution.cppn.brain import brain_outputs, grow_brain
from coordinator.evolution.cppn.network import CppnGenome
from schema.errors import ExperimentError
from schema.experiment.brains import neuron_kinds
from schema.experiment.document import Experiment
from schema.parts import BodySpace
from schema.robot.ids import BirthId
from schema.robot.robot import Robot

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
        self._outputs = (*body_outputs(types), *brain_outputs(self._neurons))
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
