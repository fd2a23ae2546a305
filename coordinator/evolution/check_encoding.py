"""Check of an encoding before the first birth, on a few dozen genomes."""

from collections.abc import Callable
from functools import partial

import numpy as np

from coordinator.evolution.encodings import IslandEncoding, encoding_of
from schema.errors import ExperimentError, InvalidRobot
from schema.experiment.document import Experiment
from schema.plugins.contract import broken, repeated
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
    encoding = encoding_of(experiment)
    try:
        genomes = [_random(encoding, number) for number in range(_GENOMES)]
        couples = [(genomes[k], genomes[k - 1]) for k in range(_GENOMES)]
        children = [_child(encoding, couple, k) for k, couple in enumerate(couples)]
    except InvalidRobot as error:
        raise ExperimentError(f"must make robots within [space], got {error}") from None
    if not any(children):
        raise broken("", "make a child of some couple", came=f"None of all {_GENOMES}")


def _random(encoding: IslandEncoding, number: int) -> object:
    """Return a random genome, checked."""

    def make() -> object:
        return encoding.random(np.random.default_rng(number), BirthId(0, number))

    genome = _made(encoding, "random", make)
    if genome is None:
        raise broken("random", "return a genome", came="None")
    return genome


def _child(encoding: IslandEncoding, couple: tuple[object, object], k: int) -> bool:
    """Mate two genomes; return whether there is a child, which is checked."""
    parents = [encoding.to_bytes(each) for each in couple]

    def make() -> object:
        birth = BirthId(0, _GENOMES + k)
        return encoding.mate(*couple, np.random.default_rng(k), birth)

    child = _made(encoding, "crossover and mutate", make)
    if parents != [encoding.to_bytes(each) for each in couple]:
        rule = "leave parents as they are"
        raise broken("crossover and mutate", rule, came="changed ones")
    return child is not None


def _made(encoding: IslandEncoding, what: str, make: Callable[[], object]) -> object:
    """Return a genome, None if there is none; raise unless it is repeatable."""
    genomes: list[object] = []

    def written() -> bytes | None:
        genomes.append(make())
        return None if genomes[-1] is None else encoding.to_bytes(genomes[-1])

    data = repeated(what, written)
    if data is None:
        return None
    read = encoding.from_bytes(data)
    if encoding.to_bytes(read) != data:
        raise broken("from_bytes", "give the genome back", came="another one")
    robot = repeated("develop", partial(encoding.develop, genomes[0]))
    if any(encoding.develop(each) != robot for each in (genomes[1], read)):
        raise broken(
            "develop", "make equal robots of equal genomes", came="another one"
        )
    # Of the thesis's encoding, robots are not checked at each birth.
    encoding.check(robot)
    return genomes[0]
