"""Genomes as the Python API has them: what evolution varies."""

from dataclasses import dataclass, field
from pathlib import Path
from typing import Self

import numpy as np

from coordinator.evolution.encodings import IslandEncoding, encoding_of
from revolve.experiment import Experiment, document_of
from revolve.robot import DEFAULT, Robot, as_experiment, of_plain
from schema.errors import RevolveError, shown
from schema.robot.ids import BirthId

_NUMBERS = 2**32
"""Number of different births that new genes are named after."""


@dataclass(frozen=True, slots=True)
class Genome:
    """Genome of a robot.

    Attributes:
        value: as the experiment's encoding makes it; of ``revolve-angle`` the root of a
            tree of nodes, each with a part, its neurons and their connections.
        experiment: whose encoding, part types, limits and probabilities apply.
    """

    value: object
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
            RevolveError: ``rng`` is no generator of NumPy.
        """
        own, birth = as_experiment(experiment), _birth(rng)
        return cls(_encoding(own).random(rng, birth), own)

    def mate(self, other: Self, rng: np.random.Generator) -> Self | None:
        """Return a child by crossover and mutation; None if the attempt fails.

        Args:
            other: the second parent; with ``revolve-angle`` it gives a subtree, and
                this one gives the root.
            rng: all draws come from it.

        Raises:
            RevolveError: ``other`` is no genome, or of another encoding; ``rng`` as for
                ``random``.
        """
        if not isinstance(other, Genome):
            raise RevolveError(f"other: must be a Genome, got {shown(other)}")
        first, second = (
            document_of(each.experiment).encoding.type for each in (self, other)
        )
        if first != second:
            raise RevolveError(
                f"genomes of different encodings cannot mate: {first!r} and {second!r}"
            )
        encoding, birth = _encoding(self.experiment), _birth(rng)
        child = encoding.mate(self.value, other.value, rng, birth)
        return None if child is None else type(self)(child, self.experiment)

    def develop(self) -> Robot:
        """Return the robot that the genome describes.

        Raises:
            InvalidRobot: it breaks a limit of ``[space]``; never with built-in
                encodings.
        """
        robot = _encoding(self.experiment).develop(self.value)
        return of_plain(robot, self.experiment)

    def to_bytes(self) -> bytes:
        """Return the genome as bytes."""
        return _encoding(self.experiment).to_bytes(self.value)

    @classmethod
    def from_bytes(cls, data: bytes, experiment: Experiment | str | Path) -> Self:
        """Return the genome of bytes that ``to_bytes`` returned.

        Raises:
            RevolveError: other bytes.
            ExperimentError: no such experiment.
        """
        own = as_experiment(experiment)
        return cls(_encoding(own).from_bytes(data), own)


def _encoding(experiment: Experiment) -> IslandEncoding:
    return encoding_of(document_of(experiment))


def _birth(rng: np.random.Generator) -> BirthId:
    """Return a random id that makes the new genes of a genome distinct."""
    if not isinstance(rng, np.random.Generator):
        raise RevolveError(
            f"rng: must be a numpy.random.Generator, got {shown(rng)}; "
            "numpy.random.default_rng(SEED) returns one"
        )
    return BirthId(0, int(rng.integers(_NUMBERS)))
