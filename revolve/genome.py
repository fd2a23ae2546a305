"""Genomes as the Python API has them: what evolution varies."""

from dataclasses import dataclass, field
from pathlib import Path
from typing import Self

import numpy as np

from coordinator.evolution.generation import generate
from coordinator.evolution.variation import mate
from revolve.experiment import Experiment, document_of
from revolve.robot import DEFAULT, Robot, as_experiment, of_plain
from schema.experiment.document import body_space
from schema.robot.genome import Node, develop
from schema.robot.ids import BirthId
from schema.wire.codec import decode_genome, encode_genome

_NUMBERS = 2**32
"""Number of different births that new genes are named after."""


@dataclass(frozen=True, slots=True)
class Genome:
    """Genome of a robot.

    Attributes:
        root: its tree of nodes; each has a part, its neurons and their connections.
        experiment: whose part types, limits and probabilities apply.
    """

    root: Node
    experiment: Experiment = field(compare=False, repr=False)

    @classmethod
    def random(
        cls, rng: np.random.Generator, experiment: Experiment | str | Path = DEFAULT
    ) -> Self:
        """Return a random genome as evolution starts with.

        Args:
            rng: all draws come from it.
            experiment: whose restrictions it meets.

        Raises:
            ExperimentError: no such experiment, or it allows (nearly) no robot.
        """
        own = as_experiment(experiment)
        return cls(generate(rng, document_of(own), _birth(rng)), own)

    def mate(self, other: Self, rng: np.random.Generator) -> Self | None:
        """Return a child by crossover and mutation; None if the attempt fails.

        Args:
            other: the parent that gives a subtree; this one gives the root.
            rng: all draws come from it.
        """
        document = document_of(self.experiment)
        child = mate(self.root, other.root, rng, document, _birth(rng))
        return None if child is None else type(self)(child, self.experiment)

    def develop(self) -> Robot:
        """Return the robot that the genome describes."""
        space = body_space(document_of(self.experiment).space)
        return of_plain(develop(self.root, space), self.experiment)

    def to_bytes(self) -> bytes:
        """Return the genome as bytes."""
        return encode_genome(self.root)

    @classmethod
    def from_bytes(cls, data: bytes, experiment: Experiment | str | Path) -> Self:
        """Return the genome of bytes that ``to_bytes`` returned.

        Raises:
            RevolveError: other bytes.
            ExperimentError: no such experiment.
        """
        return cls(decode_genome(data), as_experiment(experiment))


def _birth(rng: np.random.Generator) -> BirthId:
    """Return a name of its own for the new genes of a genome."""
    return BirthId(0, int(rng.integers(_NUMBERS)))
