"""Making of children, random robots and given founders: what analyzers do at a birth.

Each is a pure function of experiment, seed, run, birth and parents, so that it does not
matter which process makes it.
"""

from collections.abc import Callable
from functools import lru_cache, partial

import numpy as np

from coordinator.evolution.breeding import Breeder, at_birth
from coordinator.evolution.encodings import IslandEncoding, encoding_of
from coordinator.evolution.random_streams import Purpose, stream
from schema.errors import ExperimentError, InvalidRobot, MalformedMessage
from schema.experiment.document import Experiment, Vetting
from schema.experiment.settings import read_breeding_settings
from schema.limits import LONGEST_REASON, printable
from schema.parts import BodySpace
from schema.robot.ids import BirthId
from schema.robot.results import Report
from schema.robot.robot import Robot
from schema.wire.messages import Bred, Breed, Failure, Request

Vet = Callable[[Robot, BodySpace, Vetting], Report]
Draws = Callable[[int, Purpose], np.random.Generator]
"""Returns the random stream of an attempt at a birth."""


def breed(request: Request, vet: Vet) -> Bred | Failure:
    """Return the child that a request asks for, or why there is none.

    No robot that meets the restrictions, or an encoding whose own code fails, is a
    failure: any analyzer would fail, and the run cannot continue.

    ``vet``: reports on a body; an analyzer's.

    Raises:
        MalformedMessage: other work.
        ExperimentError: invalid settings.
        InvalidRobot: parents that are no genomes of the encoding.
    """
    work, origin = request.work, request.origin
    if not isinstance(work, Breed):
        raise MalformedMessage("an analyzer breeds only")
    experiment, encoding = _read(request.settings)

    def why_not(robot: Robot, _attempt: int = 0) -> str:
        return vet(robot, encoding.types, experiment.vetting).reason

    draws = partial(stream, origin.seed, origin.run, work.birth)
    try:
        with at_birth(work.birth):
            return newborn(work, encoding, draws, why_not)
    except ExperimentError as error:
        return Failure(printable(str(error), LONGEST_REASON))


@lru_cache(maxsize=64)
def _read(settings: bytes) -> tuple[Experiment, IslandEncoding]:
    experiment = read_breeding_settings(settings)
    return experiment, encoding_of(experiment)


def newborn(
    work: Breed,
    encoding: IslandEncoding,
    draws: Draws,
    why_not: Callable[[Robot, int], str],
) -> Bred:
    """Return the child of the first attempt that gives a viable one.

    ``why_not``: returns why the robot of an attempt is not viable, or nothing.
    """
    given, parents = work.founder, [encoding.kept(data) for data in work.parents]
    founder = None if given is None else encoding.from_bytes(given)
    reasons: list[str] = []
    for attempt in range(work.attempt, work.end):
        why, genome = encoding.no_child, founder
        if parents:
            rng = draws(attempt, Purpose.MATE)
            genome = encoding.mate(parents[0], parents[-1], rng, work.birth)
        elif genome is None:
            rng = draws(attempt, Purpose.GENERATE)
            genome = encoding.random(rng, work.birth)
        if genome is not None:
            try:
                robot = encoding.develop(genome)
            except InvalidRobot as error:
                why = str(error)
            else:
                why = why_not(robot, attempt)
                if not why:
                    child = encoding.newborn(genome, robot)
                    return Bred(work.birth, work.attempt, tuple(reasons), child)
        reasons.append(printable(why, LONGEST_REASON))
    return Bred(work.birth, work.attempt, tuple(reasons))


def founder(
    experiment: Experiment,
    seed: int,
    number: int,
    why_not: Callable[[Robot, int], str] = lambda _robot, _attempt: "",
) -> Robot:
    """Return a random founder of the first run with a seed, made in this process.

    ``why_not``: as of ``newborn``.

    Raises:
        ExperimentError: (nearly) no robot meets the restrictions.
    """
    breeder, birth = Breeder(experiment, seed, run=0), BirthId(0, number)
    draws, bred = partial(stream, seed, 0, birth), Bred(birth, 0)
    while bred.child is None:
        work, _ = breeder.request(birth, len(bred.reasons) + bred.attempt, (), bred.why)
        with at_birth(birth):
            bred = newborn(work, encoding_of(experiment), draws, why_not)
    return bred.child.robot
