"""Revolve Angle, the encoding of the thesis: the genome is the tree of parts itself.

Source: Hupkes 2016, section 4.4.
"""

import numpy as np

from coordinator.evolution.generation import generate
from coordinator.evolution.mutable_genome import (
    MutableGenome,
    gene_ids,
    level,
    preorder,
    to_branches,
    to_genome,
    to_mutable,
)
from coordinator.evolution.random_streams import BufferedRng
from coordinator.evolution.variation import crossover, mate, mutate
from schema.errors import InvalidRobot
from schema.experiment.document import Experiment
from schema.parts import BodySpace
from schema.robot.genome import Genome, develop, walk
from schema.robot.ids import BirthId
from schema.robot.inverse_development import genome_of
from schema.robot.robot import Robot
from schema.wire.codec import decode_genome, encode_genome


class RevolveAngle:
    """Encoding by trees of parts; a plug-in of the kind ``encoding.type``.

    The sections ``[generation]`` and ``[variation]`` are its parameters.
    """

    def __init__(
        self, experiment: Experiment, types: BodySpace, _parameters: None
    ) -> None:
        self._experiment = experiment
        self._types = types

    def random(self, rng: np.random.Generator, birth: BirthId) -> Genome:
        """Return the genome of a random robot with at least one motor.

        Raises:
            ExperimentError: no random tree meets the restrictions.
        """
        return generate(rng, self._experiment, birth)

    def develop(self, genome: Genome) -> Robot:
        """Return the robot that a genome describes."""
        return develop(genome, self._types)

    def mate(
        self, first: Genome, second: Genome, rng: np.random.Generator, birth: BirthId
    ) -> Genome | None:
        """Return the genome of a child: crossover and mutation of one mutable tree."""
        return mate(first, second, rng, self._experiment, birth)

    def crossover(
        self, first: Genome, second: Genome, rng: np.random.Generator
    ) -> Genome | None:
        """Return the first genome with a subtree of the second, or None."""
        branches, donors = (to_branches(each, self._types) for each in (first, second))
        is_done = crossover(BufferedRng(rng), branches, donors, self._experiment)
        return self._genome(branches[0]) if is_done else None

    def mutate(
        self, genome: Genome, rng: np.random.Generator, birth: BirthId
    ) -> Genome | None:
        """Return a mutated genome, or None if no motor is left."""
        root = to_mutable(genome, self._types)
        mutate(BufferedRng(rng), root, gene_ids(birth), self._experiment)
        has_motor = any(branch.outputs for branch in preorder(root))
        return self._genome(root) if has_motor else None

    def to_bytes(self, genome: Genome) -> bytes:
        """Return the Protobuf bytes of a genome."""
        return encode_genome(genome)

    def from_bytes(self, data: bytes) -> Genome:
        """Return the genome of Protobuf bytes.

        Raises:
            MalformedMessage: other bytes.
            InvalidRobot: a part type that the experiment does not have.
        """
        genome = decode_genome(data)
        for node, _, _ in walk(genome):
            if node.kind not in self._types:
                raise InvalidRobot(
                    f"genome: part types are {', '.join(self._types)}, "
                    f"got {node.kind!r}"
                )
        return genome

    def from_robot(self, robot: Robot) -> Genome:
        """Return the genome that develops into a robot."""
        return genome_of(robot)

    def _genome(self, root: MutableGenome) -> Genome:
        branches = preorder(root)
        if self._experiment.space.planar:
            level(branches)
        return to_genome(branches)
