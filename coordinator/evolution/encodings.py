"""The encoding of an island: loading, and checks of what it returns.

A coordinator has genomes as bytes; who breeds decodes them, once.
"""

from collections.abc import Callable
from contextlib import AbstractContextManager, nullcontext
from functools import lru_cache
from typing import Any, cast

import numpy as np

from coordinator.evolution.cppn.encoding import Cppn
from coordinator.evolution.revolve_angle import RevolveAngle
from schema.errors import ExperimentError, InvalidRobot, one_line
from schema.experiment.brains import NoParameters, types_of
from schema.experiment.document import REVOLVE_ANGLE, Experiment, Space, body_space
from schema.limits import ROBOT_BYTES
from schema.parts import BodySpace
from schema.plugins.contract import broken
from schema.plugins.load import load_object
from schema.plugins.origin import naming_plugin
from schema.plugins.parameters import read_parameters
from schema.plugins.protocols import Encoding, OneStepMating, RobotEncoding
from schema.robot.brain import Brain
from schema.robot.genome import Node, walk
from schema.robot.ids import BirthId
from schema.robot.inverse_development import with_brain
from schema.robot.robot import Robot, check_robot
from schema.wire.messages import Newborn
from schema.wire.protobuf import count_nodes

WHERE = "encoding.type"
BUILT_IN: dict[str, Callable[..., Encoding[Any]]] = {
    REVOLVE_ANGLE: RevolveAngle,
    "cppn": Cppn,
}
"""Built-in encodings by their short names."""

_MOST_KEPT = 1024
METHODS = ("random", "develop", "crossover", "mutate", "to_bytes", "from_bytes")
"""Methods that an own encoding must have."""


@lru_cache(maxsize=64)
def encoding_of(experiment: Experiment) -> "IslandEncoding":
    """Return the encoding of one island.

    Raises:
        UnknownPlugin: no such encoding, or a module that is not allowed.
        ExperimentError: a class without the methods of an encoding, invalid
            parameters, or an error when the class is called.
    """
    name = experiment.encoding.type
    found = load_object(name, WHERE, BUILT_IN, METHODS)
    if not callable(found):
        raise ExperimentError(f"{WHERE}: {name!r} must be a class, not an object")
    kind = getattr(found, "Parameters", None)
    table = experiment.encoding.parameters
    parameters = read_parameters(table, kind or NoParameters, "encoding.parameters")
    types = body_space(experiment.space)
    with naming_plugin(WHERE, found):
        made = found(experiment, types, parameters if kind else None)
    return IslandEncoding(made, experiment)


class IslandEncoding:
    """Encoding as an island uses it.

    An error of its code becomes one line. Robots of all encodings but the thesis's
    are checked at each birth.

    Attributes:
        name: of the experiment's key ``encoding.type``.
        no_child: reason of a failed attempt at which it gave no genome.
        stores_robots: births hold the robot, as its genome does not suffice.
        random: returns the genome of a random robot; ``ExperimentError`` if no robot
            meets the restrictions.
        mate: returns the genome of the child of two; None if the attempt fails.
        develop: returns the robot that a genome describes; ``InvalidRobot`` if it is
            not well formed or breaks a limit of ``[space]``, never of the thesis's.
    """

    random: Callable[[np.random.Generator, BirthId], object]
    mate: Callable[[Any, Any, np.random.Generator, BirthId], object | None]
    develop: Callable[[Any], Robot]
    to_bytes: Callable[[Any], bytes]

    def __init__(self, encoding: Encoding[Any], experiment: Experiment) -> None:
        self.name = experiment.encoding.type
        self.types, self._kinds = types_of(experiment)
        self._encoding = encoding
        self._space = experiment.space
        self._kept: dict[bytes, object] = {}
        self.stores_robots = self.name != REVOLVE_ANGLE
        self.no_child = "its parents' genomes gave no child"
        code: RevolveAngle | _CheckedCode = _CheckedCode(encoding, self, experiment)
        self.develop = code.develop
        # Not of a user's subclass.
        if not self.stores_robots and isinstance(encoding, RevolveAngle):
            self.no_child = (
                "crossover found no fitting subtree, or the child had no motor"
            )
            self.develop = encoding.develop
            if ":" not in experiment.brain.type:
                code = encoding
        self.random, self.mate, self.to_bytes = code.random, code.mate, code.to_bytes

    def check(self, robot: Robot) -> None:
        """Raise ``InvalidRobot`` unless types and brain are those of the experiment."""
        check_robot(robot, self.types, self._kinds)

    def from_bytes(self, data: bytes) -> object:
        """Return the genome of some bytes; raise ``InvalidRobot`` for others."""
        try:
            return self._encoding.from_bytes(data)
        except Exception as error:
            raise InvalidRobot(
                f"not a genome of encoding {self.name!r}: {one_line(error)}"
            ) from error

    def kept(self, data: bytes) -> object:
        """Return the genome of some bytes, decoded once; errors as of ``from_bytes``.

        Most parents were bred by this process.
        """
        if data not in self._kept:
            self._keep(data, self.from_bytes(data))
        return self._kept[data]

    def _keep(self, data: bytes, genome: object) -> None:
        if len(self._kept) >= _MOST_KEPT:
            self._kept.clear()
        self._kept[data] = genome

    def newborn(self, genome: object, robot: Robot) -> Newborn:
        """Return what is known of a viable robot that develops from a genome."""
        data = self.to_bytes(genome)
        self._keep(data, genome)
        connections = len(robot.brain.connections)
        if isinstance(genome, Node):
            connections = sum(len(node.connections) for node, _, _ in walk(genome))
        return Newborn(data, robot, connections)

    def check_newborn(self, newborn: Newborn) -> None:
        """Raise unless a newborn of another process can live in the experiment.

        That its genome is a child of its parents, and develops into the robot, is not
        checked.

        Raises:
            InvalidRobot: no robot of the experiment.
            MalformedMessage: no genome, of the thesis's encoding.
        """
        robot = newborn.robot
        self.check(robot)
        problem = outside_limits(robot, self._space, self.types)
        if not self.stores_robots and count_nodes(newborn.genome) != len(robot.parts):
            problem = "its genome has another number of parts than its robot"
        if problem:
            raise InvalidRobot(problem)

    def robot_of(self, data: bytes) -> Robot:
        """Return the robot that develops from the bytes of a genome.

        Raises:
            InvalidRobot: other bytes, or as of ``develop``.
        """
        return self.develop(self.from_bytes(data))

    def from_robot(self, robot: Robot) -> object:
        """Return a genome of a robot.

        Raises:
            InvalidRobot: the encoding cannot describe this robot, or none at all.
        """
        if not isinstance(self._encoding, RobotEncoding):
            raise InvalidRobot(
                f"encoding {self.name!r} makes no genome of a given robot, so a "
                "robot's file cannot join this experiment"
            )
        try:
            return self._encoding.from_robot(robot)
        except ValueError as error:
            raise InvalidRobot(
                f"encoding {self.name!r} cannot describe this robot: {error}"
            ) from error

    def with_brain(self, data: bytes, robot: Robot) -> Newborn:
        """Return a robot at birth with the brain that it has learnt in its genome.

        ``data``: the genome that it inherited.

        Raises:
            InvalidRobot: the encoding cannot describe the robot.
        """
        if self.stores_robots:
            return self.newborn(self.from_robot(robot), robot)
        genome = cast("Node", self.kept(data))
        return self.newborn(with_brain(genome, robot, self.types), robot)

    @property
    def describes_robots(self) -> bool:
        """Whether it makes a genome of a given robot."""
        return isinstance(self._encoding, RobotEncoding)


class _CheckedCode:
    """Calls of an encoding that may run own code, with checks of what it returns.

    Errors of own code are ``ExperimentError``, with its name.
    """

    def __init__(
        self, encoding: Encoding[Any], used: IslandEncoding, experiment: Experiment
    ) -> None:
        self._encoding, self._used = encoding, used
        self._mates = encoding if isinstance(encoding, OneStepMating) else None
        self._space = experiment.space
        self._own = WHERE, type(encoding), used.name
        if ":" not in used.name:
            self._own = "brain.type", type(encoding), experiment.brain.type

    def _named(self) -> AbstractContextManager[None]:
        key, plugin, path = self._own
        return naming_plugin(key, plugin, path) if ":" in path else nullcontext()

    def random(self, rng: np.random.Generator, birth: BirthId) -> object:
        with self._named():
            return self._encoding.random(rng, birth)

    def mate(
        self, first: object, second: object, rng: np.random.Generator, birth: BirthId
    ) -> object | None:
        with self._named():
            if self._mates is not None:
                return self._mates.mate(first, second, rng, birth)
            child = self._encoding.crossover(first, second, rng)
            return None if child is None else self._encoding.mutate(child, rng, birth)

    def develop(self, genome: object) -> Robot:
        name, types = self._used.name, self._used.types
        with self._named():
            developed: object = self._encoding.develop(genome)
            parts = getattr(developed, "parts", None)
            brain = getattr(developed, "brain", None)
            if not isinstance(parts, tuple | list) or not isinstance(brain, Brain):
                raise broken("develop", "return a Robot", developed)
            # The Python API has a class of its own.
            robot = Robot(tuple(parts), brain)
            self._used.check(robot)
            if problem := outside_limits(robot, self._space, types):
                raise InvalidRobot(f"{WHERE}: {name!r}: {problem}")
        return robot

    def to_bytes(self, genome: object) -> bytes:
        with self._named():
            data: object = self._encoding.to_bytes(genome)
            if not isinstance(data, bytes) or len(data) > ROBOT_BYTES:
                raise broken("to_bytes", f"return <= {ROBOT_BYTES} bytes", data)
        return data


def outside_limits(robot: Robot, space: Space, types: BodySpace) -> str:
    """Return which limit of ``[space]`` a well-formed robot breaks; or nothing."""
    brain = robot.brain
    for name, count, least, most in (
        ("parts", len(robot.parts), space.min_parts, space.max_parts),
        ("inputs", brain.count("input"), 0, space.max_inputs),
        ("outputs", brain.count("output"), 0, space.max_outputs),
        ("hidden", brain.count("hidden"), 0, space.max_hidden),
    ):
        if not least <= count <= most:
            limits = f"space.max_{name} = {most}"
            if least:
                limits = f"space.min_{name} = {least} and {limits}"
            return f"the robot has {count} {name}, outside {limits}"
    turns: list[int] = []
    for index, part in enumerate(robot.parts if space.planar else ()):
        turn = part.orientation + (turns[part.parent] if index else 0)
        if turn % 360 and types[part.kind].is_levelled:
            return (
                f"part {index}, a {part.kind}, is rotated by {turn % 360} degrees out "
                "of the core's plane, but space.planar is true"
            )
        turns.append(turn)
    return ""
