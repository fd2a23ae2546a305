"""Protocols of plug-ins: what each kind gets and returns."""

from typing import Protocol, TypeVar, runtime_checkable

import numpy as np

from schema.robot.ids import BirthId
from schema.robot.robot import Robot

Genome = TypeVar("Genome")
"""Type of the genomes of an encoding: immutable, compared by value."""
Made_co = TypeVar("Made_co", covariant=True)


class Encoding(Protocol[Genome]):
    """Encoding of robots in genomes, ``encoding.type``; runs in the coordinator.

    The experiment names a class. It is called once for each island, as
    ``Class(experiment, types, parameters)``: the settings of the island, whose
    limits of robots are ``experiment.space``; the part types by name; and the
    parameters: an instance of the msgspec Struct that the class has as its attribute
    ``Parameters``, read from the table ``[encoding.parameters]``; None without it.

    All methods are pure functions of the object and their arguments: no clock, file
    or global random state, and nothing is kept from one call to the next. ``rng`` is
    a ``numpy.random.Generator`` (PCG64) that belongs to this attempt at this birth
    alone, ``SeedSequence(seed, spawn_key=(run, island, birth, attempt, purpose))``;
    `crossover` and `mutate` of one attempt get the same one, in this order. Draw from
    nothing else: then births do not depend on the number of workers.

    The run ends with one line if a method raises. A robot that breaks a limit of
    ``[space]`` counts as a failed attempt at its birth.
    """

    def random(self, rng: np.random.Generator, birth: BirthId) -> Genome:
        """Return the genome of a random robot.

        Args:
            rng: the only source of randomness.
            birth: id of the individual; identities of its genes may derive from it.
        """
        ...

    def develop(self, genome: Genome) -> Robot:
        """Return the robot that a genome describes.

        The robot is well formed (``check_robot``) and within the limits of
        ``[space]``: numbers of parts, inputs, outputs and hidden neurons; planar if
        the experiment says so. Whether its parts intersect, and whether it has a
        motor, is checked later.
        """
        ...

    def crossover(
        self, first: Genome, second: Genome, rng: np.random.Generator
    ) -> Genome | None:
        """Return a genome made of two parents', or None if they cannot mate.

        Args:
            first: genome of a parent.
            second: genome of the other one, which was selected second.
            rng: the only source of randomness.
        """
        ...

    def mutate(
        self, genome: Genome, rng: np.random.Generator, birth: BirthId
    ) -> Genome | None:
        """Return a mutated genome, or None if no robot may develop from it.

        Args:
            genome: what `crossover` returned.
            rng: the only source of randomness, as `crossover` left it.
            birth: id of the child; identities of its new genes may derive from it.
        """
        ...

    def to_bytes(self, genome: Genome) -> bytes:
        """Return a genome as bytes, for tables and the journal; at most 1 MiB."""
        ...

    def from_bytes(self, data: bytes) -> Genome:
        """Return the genome that `to_bytes` wrote.

        Raises:
            ValueError: other bytes.
        """
        ...


@runtime_checkable
class OneStepMating(Protocol[Genome]):
    """Encoding that crosses and mutates in one step; the two methods are not called."""

    def mate(
        self, first: Genome, second: Genome, rng: np.random.Generator, birth: BirthId
    ) -> Genome | None:
        """Return the genome of a child, or None; arguments as of the two methods."""
        ...


@runtime_checkable
class RobotEncoding(Protocol[Made_co]):
    """Encoding that can describe a given robot.

    Only with such an encoding can an operator insert a robot's file into an arena.
    """

    def from_robot(self, robot: Robot) -> Made_co:
        """Return a genome from which a robot develops.

        Raises:
            ValueError: the encoding cannot describe this robot.
        """
        ...
