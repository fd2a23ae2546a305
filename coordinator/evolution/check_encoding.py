"""Check of an encoding before the first birth, on a few dozen genomes."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np

from coordinator.evolution.encodings import IslandEncoding, encoding_of, outside_limits
from schema.errors import ExperimentError, InvalidRobot
from schema.experiment.document import Experiment, Space
from schema.plugins.contract import broken, repeated
from schema.robot.ids import BirthId

_GENOMES = 24

Look = Callable[[object, bool], None]
"""Check of a genome, and whether it is a random one."""


def check_encoding(experiment: Experiment, look: Look = lambda *_: None) -> None:
    """Raise unless the encoding of an island keeps its contract.

    Random genomes and their children are made twice from equal random streams, written
    as bytes and read, and developed. No robot is evaluated. ``look`` raises for a
    genome that breaks another rule.

    Raises:
        UnknownPlugin: no such encoding.
        ExperimentError: another result from equal arguments, a robot that breaks a
            limit, bytes that do not give the genome back, changed parents, no child
            of any couple, or a method that raises.
    """
    case = _Case(encoding_of(experiment), experiment.space, look)
    try:
        genomes = [case.random(number) for number in range(_GENOMES)]
        children: list[object] = []
        for number in range(_GENOMES):
            # Children of children, too.
            couple = genomes[number], (children or genomes)[-1]
            if (child := case.child(couple, number)) is not None:
                children.append(child)
    except InvalidRobot as error:
        raise ExperimentError(f"must make robots within [space], got {error}") from None
    if not children:
        came = f"None of all {_GENOMES}"
        raise broken("", "make a child of some couple", came=came)


@dataclass(frozen=True, slots=True)
class _Case:
    """An encoding, and what its methods must return."""

    encoding: IslandEncoding
    space: Space
    look: Look

    def random(self, number: int) -> object:
        """Return a random genome, checked."""

        def make() -> object:
            rng = np.random.default_rng(number)
            return self.encoding.random(rng, BirthId(0, number))

        genome = self._made("random", make, is_random=True)
        if genome is None:
            raise broken("random", "return a genome")
        return genome

    def child(self, couple: tuple[object, object], number: int) -> object:
        """Return a child of two genomes, checked; None if there is none."""
        parents = [self.encoding.to_bytes(parent) for parent in couple]

        def make() -> object:
            birth = BirthId(0, _GENOMES + number)
            return self.encoding.mate(*couple, np.random.default_rng(number), birth)

        child = self._made("crossover and mutate", make, is_random=False)
        if parents != [self.encoding.to_bytes(parent) for parent in couple]:
            rule = "leave parents as they are"
            raise broken("crossover and mutate", rule, came="changed ones")
        return child

    def _made(
        self, what: str, make: Callable[[], object], *, is_random: bool
    ) -> object:
        """Return a genome, None if there is none; raise unless it is repeatable."""
        encoding = self.encoding
        genomes: list[object] = []

        def written() -> bytes | None:
            genomes.append(make())
            if genomes[-1] is None:
                return None
            self.look(genomes[-1], is_random)
            return encoding.to_bytes(genomes[-1])

        data = repeated(what, written)
        if data is None:
            return None
        read = encoding.from_bytes(data)
        if encoding.to_bytes(read) != data:
            raise broken("from_bytes", "give the genome back", came="another one")
        robot = repeated("develop", partial(encoding.develop, genomes[0]))
        if any(encoding.develop(equal) != robot for equal in (genomes[1], read)):
            rule = "make equal robots of equal genomes"
            raise broken("develop", rule, came="another one")
        # Of the thesis's encoding, robots are not checked at each birth.
        encoding.check(robot)
        if problem := outside_limits(robot, self.space, encoding.types):
            raise InvalidRobot(problem)
        return genomes[0]
