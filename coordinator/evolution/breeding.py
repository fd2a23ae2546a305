"""Individuals, the candidates that become individuals, and requests for candidates.

Every candidate is a pure function of seed, run, birth, attempt and parents; analyzers
make it (``coordinator.evolution.newborns``). Attempts are numbered through all couples
of a birth, so that each has its own stream.
"""

from collections.abc import Iterable, Mapping, Sequence
from contextlib import AbstractContextManager
from functools import partial
from types import MappingProxyType
from typing import Annotated

from msgspec import Meta, Struct
from msgspec.structs import force_setattr, replace

from coordinator.evolution.encodings import encoding_of
from coordinator.evolution.founders import Founder
from coordinator.evolution.members import Relatives
from coordinator.evolution.random_streams import Purpose, stream
from coordinator.evolution.rules import Rule, rule_of, select_survivors
from coordinator.evolution.selection import cull_population
from schema.errors import ExperimentError, naming
from schema.experiment.document import Experiment
from schema.experiment.section import AtLeastOne, Count
from schema.limits import LONGEST_NAME, MOST_MEASURES, MOST_PARTS, ROBOT_BYTES, Finite
from schema.robot.ids import BirthId
from schema.robot.results import Evaluation, failed_fitness
from schema.robot.robot import Robot
from schema.wire.codec import Message
from schema.wire.messages import Bred, Breed
from schema.wire.operator import MOST_PARENTS

NO_MEASURES: Mapping[str, float] = MappingProxyType({})
_COUPLES = 100
"""Number of couples that may fail at one birth before `Breeder` gives up."""


_Measure = Annotated[str, Meta(max_length=LONGEST_NAME)]


class Individual(Message, frozen=True):
    """Member of a population; a migrant between coordinators travels as it is.

    Attributes:
        genome: bytes of what its children inherit.
        fitness: always maximised; where its evaluation failed 0, or the least of its
            population below 0.
        rank: 1 without parents, else 1 + the greatest of theirs (thesis eq. 6.1).
        generation: number of its brood; founders are 0; None on-line.
        has_failed: its evaluation ended without a fitness.
        parents: birth ids of its parents; empty for a random robot.
        size: number of parts of its body.
        measures: of its evaluation, by name; a selection function cannot change them.
        learnt: the robot with the brain that it learnt, if it did and its genome has
            another one.
    """

    birth: BirthId
    genome: Annotated[bytes, Meta(max_length=ROBOT_BYTES)]
    fitness: Finite
    rank: AtLeastOne
    generation: Count | None
    has_failed: bool = False
    parents: Annotated[tuple[BirthId, ...], Meta(max_length=MOST_PARENTS)] = ()
    size: Annotated[int, Meta(ge=0, le=MOST_PARTS)] = 0
    measures: Annotated[Mapping[_Measure, Finite], Meta(max_length=MOST_MEASURES)] = (
        NO_MEASURES
    )
    learnt: Robot | None = None

    def __post_init__(self) -> None:
        """Protect the measures from changes."""
        if isinstance(self.measures, dict):
            force_setattr(self, "measures", MappingProxyType(self.measures))

    def __hash__(self) -> int:
        """Return the hash of the birth id, as measures have none."""
        return hash(self.birth)

    def evaluated(
        self, evaluation: Evaluation | None, labels: Sequence[str]
    ) -> "Individual":
        """Return the individual with the results of an evaluation.

        The evaluation is None if it failed; the labels name its measures.
        """
        if evaluation is None:
            return replace(self, fitness=0.0, has_failed=True, measures=NO_MEASURES)
        return replace(
            self,
            fitness=evaluation.fitness,
            has_failed=False,
            measures=dict(zip(labels, evaluation.measures, strict=True)),
        )

    @property
    def known_fitness(self) -> float | None:
        """Its fitness; None where its evaluation failed."""
        return None if self.has_failed else self.fitness


def at_birth(birth: BirthId) -> AbstractContextManager[None]:
    """Say at which birth an error occurs, of a plug-in for example."""
    where = f"birth {birth.number} of island {birth.island}"
    return naming(where, ExperimentError)


def failed_last(individuals: Iterable[Individual]) -> list[Individual]:
    """Return individuals of which the failed ones are no fitter than the others."""
    given = list(individuals)
    least = failed_fitness(one.fitness for one in given)
    if least == 0.0:
        return given
    return [replace(one, fitness=least) if one.has_failed else one for one in given]


Couple = tuple[Individual, ...]
"""Parents, two or one; the first gives the root of the child."""


class Candidate(Struct, frozen=True):
    """Robot that may be born under a birth id.

    Attributes:
        attempt: number of the attempt that gave this candidate, from 0.
        couple: its parents; None for a random robot.
        connections: of its brain in the genome, unresolved ones included.
        learnt: as of ``Individual``.
        origin: the given founder that it is, if it is one.
    """

    birth: BirthId
    attempt: int
    couple: Couple | None
    genome: bytes
    robot: Robot
    connections: int
    learnt: Robot | None = None
    origin: Founder | None = None

    def individual(self, generation: int | None) -> Individual:
        """Return the individual, before any evaluation."""
        parents = self.couple or ()
        return Individual(
            self.birth,
            self.genome,
            fitness=0.0,
            rank=1 + max((parent.rank for parent in parents), default=0),
            generation=generation,
            parents=tuple(parent.birth for parent in parents),
            size=len(self.robot.parts),
            learnt=self.learnt,
        )


class Breeder:
    """Selector of parents and survivors for one island and run.

    What fails in a rule or an encoding is an ``ExperimentError`` that names the birth.
    ``emigrants`` is an own rule that selects them; None for a built-in one.
    """

    def __init__(
        self, experiment: Experiment, seed: int, run: int, given: Sequence[Founder] = ()
    ) -> None:
        """Initialise; ``given`` are the founders of the first births."""
        self._experiment = experiment
        self._founders = given
        self._stream = partial(stream, seed, run)
        self._relatives = relatives = Relatives(encoding_of(experiment).robot_of)
        self._parents_rule = rule_of(experiment, "parents", relatives)
        self._survivors_rule = rule_of(experiment, "survivors", relatives)
        self.emigrants: Rule | None = None
        migration = experiment.migration
        if migration is not None and ":" in migration.emigrants:
            self.emigrants = rule_of(experiment, "emigrants", relatives)
        rules = (self._parents_rule, self._survivors_rule, self.emigrants)
        self._own = [rule for rule in rules if rule is not None and rule.relatives]

    def request(
        self,
        birth: BirthId,
        attempt: int,
        population: Sequence[Individual],
        why: str = "",
        *,
        is_chosen: bool = False,
    ) -> tuple[Breed, Couple | None]:
        """Return the request for a child of one couple, or a random robot.

        It has the attempts from one on, numbered from 0 through all couples, up to the
        next ``max_mating_attempts``. The population has the possible parents, and none
        for a founder; if ``is_chosen``, it is the parents, two or one. ``why`` is the
        reason why the attempt before failed. Also returns the parents, None for a robot
        without any.

        Raises:
            ExperimentError: (nearly) no robot meets the restrictions, a given founder
                is not viable, or a rule of selection fails.
        """
        selection = self._experiment.selection
        with at_birth(birth):
            if (founder := self._founder(birth)) is not None:
                if attempt:
                    raise ExperimentError(f"the given founder is not viable: {why}")
                return Breed(birth, 0, 1, founder=founder[1].genome), None
            self._check_attempts(attempt, population, why)
            most = selection.max_mating_attempts
            end = (attempt // most + 1) * most
            if is_chosen:
                couple = tuple(population)
            elif self._is_random(population):
                end = min(end, self._experiment.generation.max_tries)
                return Breed(birth, attempt, end), None
            else:
                rng = self._stream(birth, attempt, Purpose.PARENTS)
                places = self._parents_rule.places(2, population, rng)
                couple = tuple(population[at] for at in places)
        return Breed(birth, attempt, end, tuple(one.genome for one in couple)), couple

    def candidate(self, bred: Bred, couple: Couple | None) -> Candidate | None:
        """Return the candidate that was bred for a couple; None if there is none."""
        birth, child = bred.birth, bred.child
        if child is None:
            return None
        attempt, origin = bred.attempt + len(bred.reasons), self._founder(birth)
        made = child.genome, child.robot, child.connections
        return Candidate(birth, attempt, couple, *made, origin=origin)

    def _founder(self, birth: BirthId) -> Founder | None:
        founders = self._founders
        return founders[birth.number] if birth.number < len(founders) else None

    def _check_attempts(
        self, attempts: int, population: Sequence[Individual], why: str
    ) -> None:
        """Raise ``ExperimentError`` if too many attempts at a birth have failed."""
        if self._is_random(population):
            limit, what = self._experiment.generation.max_tries, "generation.max_tries"
        else:
            limit = _COUPLES * self._experiment.selection.max_mating_attempts
            what = f"{_COUPLES} x selection.max_mating_attempts"
        if attempts >= limit:
            raise ExperimentError(
                f"no viable robot in {what} = {limit} attempts, the last because: "
                f"{why}; the restrictions in [space] and [vetting] allow (nearly) none"
            )

    def survivors(
        self, parents: Sequence[Individual], children: Sequence[Individual]
    ) -> tuple[Individual, ...]:
        """Return the population after a brood, in birth order.

        The brood has at least one child, and is in birth order.
        """
        selection = self._experiment.selection
        judged = failed_last([*parents, *children])
        parents, children = judged[: len(parents)], judged[len(parents) :]
        if selection.culling is not None:
            founders = selection.population
            return cull_population(parents, children, founders, selection.culling)
        last = children[-1].birth
        rng = self._stream(last, 0, Purpose.SURVIVORS)
        rule = self._survivors_rule
        with at_birth(last):
            return select_survivors(parents, children, rng, selection, rule)

    def settle(
        self, pool: Sequence[Individual], epoch: BirthId
    ) -> tuple[Individual, ...]:
        """Return who of natives and immigrants survives; the epoch names a stream."""
        rng = self._stream(epoch, 0, Purpose.REPLACED)
        selection, rule = self._experiment.selection, self._survivors_rule
        return select_survivors((), failed_last(pool), rng, selection, rule)

    def archive(self, population: Sequence[Individual]) -> Mapping[str, Individual]:
        """Return the archive of the rule for survivors, else that for parents."""
        archive = self._survivors_rule.archive(population)
        if archive is None:
            archive = self._parents_rule.archive(population)
        return archive or {}

    def update(
        self, population: Sequence[Individual], brood: Sequence[Individual]
    ) -> None:
        """Let the rules of selection remember a population's brood, in birth order."""
        if self._own:
            self._relatives.members([*population, *brood])  # later ancestors
        for rule in self._own:
            with at_birth(brood[-1].birth):
                rule.update(failed_last(brood))

    def _is_random(self, population: Sequence[Individual]) -> bool:
        return not population or self._experiment.selection.parents == "none"
