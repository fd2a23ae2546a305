"""Protocols of plug-ins: what each kind gets and returns."""

from collections.abc import Sequence
from typing import Protocol, TypeVar, runtime_checkable

import numpy as np

from schema.parts import Vector
from schema.robot.ids import BirthId
from schema.robot.results import Floats
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


class SensorView(Protocol):
    """What a sensor of a plug-in sees at a tick: its part, and what is around it.

    The view is valid during ``read`` only. Names of boxes are those of the part's
    shape; cylinders count as boxes. An unknown name raises ``KeyError``.
    """

    @property
    def age_s(self) -> float:
        """Simulated time since the robot's birth [s]."""

    @property
    def joint_angle(self) -> float:
        """Angle [rad] or displacement [m] of the part's joint; 0 without a joint."""

    @property
    def joint_speed(self) -> float:
        """Velocity of the part's joint [rad/s] or [m/s]; 0 without a joint."""

    @property
    def light(self) -> Vector | None:
        """Position of the light, world frame [m]; None in a world without light."""

    @property
    def others(self) -> Floats:
        """Centres of the cores of all other robots, (N, 3), world frame [m].

        By birth; N = 0 off-line.
        """

    def position(self, box: str) -> Floats:
        """Return the centre of a box, (3,), world frame [m]."""

    def rotation(self, box: str) -> Floats:
        """Return the rotation from a box's frame to the world frame, (3, 3)."""

    def touches(self, box: str) -> bool:
        """Return whether a box was in contact in the last step.

        Contacts with its own rigid segment, or one that a joint connects to it, do
        not exist.
        """

    def distance(
        self,
        box: str,
        direction: Vector,
        reach: float,
        start: Vector = (0.0, 0.0, 0.0),
    ) -> float:
        """Return how far a ray gets [m].

        The ray passes through the rigid segment of the box and meets everything else:
        the ground, scenery, other robots, and other segments of its own robot.

        Args:
            box: that sends the ray.
            direction: of the ray, of length 1, in the frame of the box.
            reach: length of the ray [m].
            start: of the ray, in the frame of the box [m].

        Returns:
            Distance from ``start`` to what the ray meets first, or ``reach``.
        """


class SensorType(Protocol):
    """Sensor of a plug-in: an object in ``PartType.sensors``.

    It has no state: ``read`` is a pure function of the view. One object serves all
    parts of its type, of all robots, off-line and in arenas, and an arena that moves
    to another machine continues with equal readings. What ``read`` raises, a wrong
    number of values, or one that is not finite, ends the evaluation of the robot as
    failed, or its life in an arena; the reason names the sensor.
    """

    @property
    def inputs(self) -> int:
        """Number of network inputs, at least 1; always the same."""

    def read(self, view: SensorView, /) -> Sequence[float]:
        """Return the values of the inputs, finite, at every tick of the brain.

        Noise of the experiment is added afterwards.
        """
