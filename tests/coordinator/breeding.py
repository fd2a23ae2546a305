"""Outcomes of breeding, as analyzers return them, with verdicts of a test."""

from collections.abc import Callable, Sequence
from functools import partial

from coordinator.arena.arena import Arena
from coordinator.evolution.breeding import Breeder, Candidate, Individual, at_birth
from coordinator.evolution.encodings import encoding_of
from coordinator.evolution.newborns import newborn
from coordinator.evolution.random_streams import stream
from coordinator.islands.island import Island
from schema.experiment.document import Experiment
from schema.robot.ids import BirthId
from schema.wire.messages import Bred, Breed

WhyNot = Callable[[BirthId, int], str]
"""Returns why the body of an attempt at a birth is not viable, or nothing."""


def viable(_birth: BirthId, _attempt: int) -> str:
    """Accept every body."""
    return ""


def reject_some(birth: BirthId, attempt: int) -> str:
    """Reject every third attempt, and some others."""
    if (birth.number + attempt) % 3 == 1:
        return "parts 1 and 2 intersect"
    return "analyzer broke thrice" if (birth.number + attempt) % 8 == 7 else ""


def bred(machine: Island | Arena, work: Breed, why_not: WhyNot = viable) -> Bred:
    """Return the outcome of a request of an island or an arena."""
    draws = partial(machine._breeder._stream, work.birth)
    verdict = partial(why_not, work.birth)
    encoding = encoding_of(machine.experiment)
    return newborn(work, encoding, draws, lambda _, attempt: verdict(attempt))


def candidate(
    experiment: Experiment, birth: BirthId, parents: Sequence[Individual] = ()
) -> Candidate:
    """Return the candidate of a birth, whose first body is viable; seed 1, run 0.

    ``parents``: possible parents; none for a random robot.
    """
    breeder, found, bred = Breeder(experiment, 1, 0), None, Bred(birth, 0)
    draws, encoding = partial(stream, 1, 0, birth), encoding_of(experiment)
    while found is None:
        attempt = bred.attempt + len(bred.reasons)
        work, couple = breeder.request(birth, attempt, parents, bred.why)
        with at_birth(birth):
            bred = newborn(work, encoding, draws, lambda _robot, _attempt: "")
        found = breeder.candidate(bred, couple)
    return found


def failed(work: Breed, reason: str = "analyzer broke thrice") -> Bred:
    """Return the outcome of which all attempts failed."""
    return Bred(work.birth, work.attempt, (reason,) * (work.end - work.attempt))
