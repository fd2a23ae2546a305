"""Check of an encoding before the first birth, on a few dozen genomes."""

from collections.abc import Callable

import numpy as np

from coordinator.evolution.encodings import (
    BUILT_IN,
    WHERE,
    IslandEncoding,
    encoding_of,
    outside_limits,
)
from schema.errors import ExperimentError, InvalidRobot
from schema.experiment.document import (
    Experiment,
)
from schema.plugins.load import load_object
from schema.plugins.origin import where_defined
from schema.robot.ids import BirthId

_GENOMES = 24


def check_encoding(experiment: Experiment) -> None:
    """Raise unless the encoding of an island keeps its contract.

    Random genomes and their children are made twice from equal random streams, written
    as bytes and read, and developed. No robot is evaluated.

    Args:
        experiment: settings of the island.

    Raises:
        UnknownPlugin: no such encoding.
        ExperimentError: another result from equal arguments, a robot that breaks a
            limit, bytes that do not give the genome back, changed parents, no child
            of any couple, or a method that raises.
    """
    case = _Case(experiment)
    genomes = [case.random(number) for number in range(_GENOMES)]
    numbers = range(_GENOMES)
    children = [case.child(genomes[k], genomes[k - 1], k) for k in numbers]
    if not any(children):
        raise case.broken("a child of some couple", f"None of all {_GENOMES}")


class _Case:
    """An encoding, and what its methods must return."""

    def __init__(self, experiment: Experiment) -> None:
        self._encoding: IslandEncoding = encoding_of(experiment)
        self._space = experiment.space
        self._code = load_object(experiment.encoding.type, WHERE, BUILT_IN)

    def broken(self, expected: str, got: str) -> ExperimentError:
        """Return the error of a broken rule."""
        where = f"{WHERE}: {where_defined(self._code)}"
        return ExperimentError(f"{where}: expected {expected}, got {got}")

    def random(self, number: int) -> object:
        """Return a random genome, checked."""
        birth = BirthId(0, number)

        def made() -> object:
            return self._encoding.random(np.random.default_rng(number), birth)

        genome = self._repeated("random", made)
        if genome is None:
            raise self.broken("random to return a genome", "None")
        return genome

    def child(self, first: object, second: object, number: int) -> bool:
        """Mate two genomes; return whether there is a child, which is checked."""
        parents = [self._encoding.to_bytes(each) for each in (first, second)]
        birth = BirthId(0, _GENOMES + number)

        def made() -> object | None:
            rng = np.random.default_rng(number)
            return self._encoding.mate(first, second, rng, birth)

        child = self._repeated("crossover and mutate", made)
        if parents != [self._encoding.to_bytes(each) for each in (first, second)]:
            raise self.broken("crossover and mutate to leave parents as they are",
                              "changed ones")  # fmt: skip
        return child is not None

    def _repeated(self, what: str, make: Callable[[], object]) -> object:
        """Return a genome, None if there is none; raise unless it is repeatable."""
        genome = make()
        again = make()
        if (genome is None) != (again is None):
            raise self.broken(f"{what}: the same of the same rng", "another result")
        if genome is None:
            return None
        data = self._encoding.to_bytes(genome)
        if self._encoding.to_bytes(again) != data:
            raise self.broken(f"{what}: the same of the same rng", "another genome")
        try:
            read = self._encoding.from_bytes(data)
            robot = self._encoding.develop(genome)
            robots = [self._encoding.develop(each) for each in (genome, again, read)]
            self._encoding.check(robot)
        except InvalidRobot as error:
            raise self.broken("a robot within [space]", str(error)) from error
        if self._encoding.to_bytes(read) != data:
            raise self.broken("from_bytes to give the genome back", "another genome")
        if any(each != robot for each in robots):
            raise self.broken("develop: the same robot of the same genome", "another")
        if problem := outside_limits(robot, self._space, self._encoding.types):
            raise self.broken("a robot within [space]", problem)
        return genome
