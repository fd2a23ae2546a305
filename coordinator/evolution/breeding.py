"""How a birth's candidates come about: made at random, or by two parents.

Every candidate is a pure function of seed, run, birth, attempt and the population:
attempts are numbered through all couples of a birth, so that no two draw alike.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from coordinator.evolution.generation import generate
from coordinator.evolution.random_streams import BufferedRng, Purpose, stream
from coordinator.evolution.selection import (
    Couple,
    Individual,
    select_parents,
    select_survivors,
)
from coordinator.evolution.variation import mate
from schema.errors import ExperimentError
from schema.experiment.document import Experiment, body_space
from schema.robot.genome import Genome, develop
from schema.robot.ids import BirthId
from schema.robot.robot import Robot

BARREN = "crossover found no fitting subtree, or the child had no motor"
"""Why an attempt comes to no candidate."""

_COUPLES = 100
"""Couples that may fail at one birth before a document is called impossible."""


@dataclass(frozen=True, slots=True)
class Candidate:
    """Who may be born under a number.

    Attributes:
        birth: the number.
        attempt: that came to this one, from 0.
        couple: its parents; None for a random robot.
        genome: what it inherits.
        robot: what that develops into.
    """

    birth: BirthId
    attempt: int
    couple: Couple | None
    genome: Genome
    robot: Robot


class Breeder:
    """Makes candidates and picks survivors for one execution of an experiment."""

    __slots__ = ("_experiment", "_run", "_seed")

    def __init__(self, experiment: Experiment, seed: int, run: int) -> None:
        self._experiment = experiment
        self._seed = seed
        self._run = run

    def attempt(
        self,
        birth: BirthId,
        number: int,
        population: Sequence[Individual],
        couple: Couple | None,
        why: str,
    ) -> tuple[Couple | None, Candidate | None]:
        """Return one attempt's parents, and the candidate if they come to one.

        Args:
            birth: who is to be born.
            number: of the attempt, from 0, through all couples of this birth.
            population: who may mate; empty for a founder.
            couple: parents of the attempt before; None at the first.
            why: the attempt before failed; empty at the first.

        Raises:
            ExperimentError: restrictions that (nearly) no robot meets.
        """
        self.check_patience(birth, number, population, why)
        couple, genome = self.conceive(birth, number, population, couple)
        if genome is None:
            return couple, None
        robot = develop(genome, body_space(self._experiment.space))
        return couple, Candidate(birth, number, couple, genome, robot)

    def conceive(
        self,
        birth: BirthId,
        attempt: int,
        population: Sequence[Individual],
        couple: Couple | None,
    ) -> tuple[Couple | None, Genome | None]:
        """Return one attempt's parents and the genome that they come to.

        Args:
            birth: whose genome it is to be.
            attempt: from 0, through all couples of this birth.
            population: who may mate; empty for a founder.
            couple: parents of the attempt before; None at attempt 0.

        Returns:
            The parents, None for a random robot; and the genome, None where mating
            came to none. After ``max_mating_attempts`` come new parents.

        Raises:
            ExperimentError: restrictions that no random robot meets.
        """
        selection = self._experiment.selection
        if self._is_random(population):
            rng = self._stream(birth, attempt, Purpose.GENERATE)
            return None, generate(rng, self._experiment, birth)
        if couple is None or attempt % selection.max_mating_attempts == 0:
            draws = BufferedRng(self._stream(birth, attempt, Purpose.PARENTS))
            couple = select_parents(population, draws, selection)
        rng = self._stream(birth, attempt, Purpose.MATE)
        first, second = couple
        return couple, mate(first.genome, second.genome, rng, self._experiment, birth)

    def check_patience(
        self, birth: BirthId, attempts: int, population: Sequence[Individual], why: str
    ) -> None:
        """Raise if a birth has failed so often that it always will.

        Args:
            birth: the one that is tried.
            attempts: that failed.
            population: who may mate; empty for a founder.
            why: the last attempt failed.

        Raises:
            ExperimentError: the document's own limit for random robots is reached,
                or a hundred couples failed.
        """
        if self._is_random(population):
            limit, what = self._experiment.generation.max_tries, "generation.max_tries"
        else:
            limit = _COUPLES * self._experiment.selection.max_mating_attempts
            what = f"{_COUPLES} x selection.max_mating_attempts"
        if attempts >= limit:
            raise ExperimentError(
                f"birth {birth.number} of island {birth.island}: no viable robot in "
                f"{what} = {limit} attempts, the last because: {why}; "
                "the restrictions in [space] and [vetting] allow (nearly) none"
            )

    def survivors(
        self,
        parents: Sequence[Individual],
        children: Sequence[Individual],
        last: BirthId,
    ) -> tuple[Individual, ...]:
        """Return the population after a brood whose last birth is ``last``."""
        draws = BufferedRng(self._stream(last, 0, Purpose.SURVIVORS))
        selection = self._experiment.selection
        return select_survivors(parents, children, draws, selection)

    def _is_random(self, population: Sequence[Individual]) -> bool:
        return not population or self._experiment.selection.parents == "none"

    def _stream(
        self, birth: BirthId, attempt: int, purpose: Purpose
    ) -> np.random.Generator:
        return stream(self._seed, self._run, birth, attempt, purpose)
