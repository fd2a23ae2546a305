"""An off-line island: who is born, is judged, and lives on. A pure machine.

Founders come first, then broods of children of the population that stands when
the brood begins. Births of a brood are in flight together, up to the experiment's
window; whatever order their answers arrive in, they are committed in birth order.
Source: Hupkes 2016, section 5.3; facts of the original, section 5.1.
"""

from dataclasses import dataclass
from math import isfinite

from coordinator.evolution.breeding import BARREN, Breeder, Candidate
from coordinator.evolution.selection import Couple, Individual
from coordinator.islands.events import (
    Answered,
    Evaluate,
    Evaluated,
    EvaluationFailed,
    Finish,
    Immigrated,
    IslandCommand,
    IslandEvent,
    MigrationEvent,
    NeighbourClosed,
    Started,
    Vet,
    Vetted,
    VettingFailed,
)
from coordinator.islands.island_migration import MigrantBuffer
from coordinator.islands.migration import MigrationEpochs
from coordinator.islands.reevaluation import Reevaluations
from coordinator.islands.rows import birth_record, evaluation_record, population_records
from coordinator.islands.survival import SurvivorSelection
from schema.errors import UnexpectedEvent
from schema.experiment.document import Experiment, body_space
from schema.robot.ids import BirthId


@dataclass(slots=True)
class _Unborn:
    """Who is to be born under a number; ``candidate`` is the one being judged."""

    candidate: Candidate
    is_viable: bool = False
    outcome: Evaluated | EvaluationFailed | None = None


class Island:
    """One population and its births.

    Attributes:
        births: how many individuals have been born and recorded.
        population: the living, in birth order.
    """

    def __init__(
        self,
        experiment: Experiment,
        seed: int,
        run: int,
        number: int = 0,
        *,
        epochs: MigrationEpochs | None = None,
    ) -> None:
        """Make an island to which nothing has happened.

        Args:
            experiment: what is evolved, and how.
            seed: of the experiment's execution.
            run: number of the repeat, from 0.
            number: of this island.
            epochs: its side of migration; None if it has no neighbours.
        """
        self.births = 0
        self.population: tuple[Individual, ...] = ()
        self._experiment = experiment
        self._number = number
        self._space = body_space(experiment.space)
        self._breeder = Breeder(experiment, seed, run)
        self._survivor_selection = SurvivorSelection(experiment, self._breeder)
        self._reevaluations = Reevaluations(experiment, seed, run, number)
        self._has_started = False
        self._generation = 0
        self._begun = 0
        # Founders need nobody's fitness: all of them are in flight together.
        self._window = self._brood_end = experiment.selection.population
        self._unborn: dict[int, _Unborn] = {}
        self._brood: list[Individual] = []
        self._migrant_buffer = (
            None if epochs is None else MigrantBuffer(experiment, number, epochs)
        )

    @property
    def judged(self) -> tuple[Individual, ...]:
        """Those of the living whose fitness is known."""
        return tuple(one for one in self.population if not one.has_failed)

    @property
    def is_finished(self) -> bool:
        """All births of the experiment have been recorded."""
        return (
            self.births == self._experiment.births and not self._reevaluations.is_open
        )

    def handle(self, event: IslandEvent) -> list[IslandCommand]:
        """Take an event and return what follows from it.

        Duplicates of answers that were taken before are ignored.

        Raises:
            UnexpectedEvent: an event that cannot come now; nothing has changed.
            ExperimentError: restrictions that no robot meets; the island cannot go
                on.
        """
        if isinstance(event, Started):
            if self._has_started:
                raise self._unexpected(event, "it has started before")
            self._has_started = True
            return self._proceed()
        if isinstance(event, Immigrated | NeighbourClosed) or (
            isinstance(event, Evaluated | EvaluationFailed) and event.trial
        ):
            self._hear(event)
            return [*self._land(), *self._proceed()]
        unborn = self._asked(event)
        if unborn is None:
            return []
        match event:
            case Vetted(report=report) if report.is_viable:
                unborn.is_viable = True
                candidate = unborn.candidate
                return [
                    self._reevaluations.timed(
                        Evaluate(candidate.birth, candidate.robot)
                    )
                ]
            case Vetted() | VettingFailed():
                why = event.report if isinstance(event, Vetted) else event
                return [self._retry(unborn.candidate, why.reason)]
            case Evaluated() | EvaluationFailed():
                unborn.outcome = event
                return self._proceed()

    def _asked(self, event: Answered) -> _Unborn | None:
        """Return the unborn that an answer is news of, None if it is none.

        Raises:
            UnexpectedEvent: an answer to what was never asked.
        """
        birth = event.birth
        if birth.island != self._number or not 0 <= birth.number < self._begun:
            raise self._unexpected(event, f"births 0..{self._begun - 1} have begun")
        unborn = self._unborn.get(birth.number)
        if unborn is None or unborn.outcome is not None:
            return None
        if isinstance(event, Vetted | VettingFailed):
            attempt = unborn.candidate.attempt
            if event.attempt > attempt:
                raise self._unexpected(event, f"it is at attempt {attempt}")
            is_old = event.attempt < attempt or unborn.is_viable
            return None if is_old else unborn
        if not unborn.is_viable:
            raise self._unexpected(event, "it has not been vetted")
        if isinstance(event, Evaluated) and not isfinite(event.evaluation.fitness):
            raise self._unexpected(event, "fitness must be finite")
        return unborn

    def _unexpected(self, event: IslandEvent, why: str) -> UnexpectedEvent:
        return UnexpectedEvent(
            f"island {self._number}, {self.births} of {self._experiment.births} born, "
            f"{self._begun} begun, brood {self._generation} ends at "
            f"{self._brood_end}: {why}, got {event}"
        )

    def _proceed(self) -> list[IslandCommand]:
        """Commit who is judged and next in turn, and begin what the window allows."""
        commands: list[IslandCommand] = []
        while (first := self._unborn.get(self.births)) and first.outcome:
            commands += self._commit(first.candidate, first.outcome)
        if self.births == self._brood_end and self._brood:
            commands += self._reevaluations.ask_anew(self.births, self.population)
            if not self._reevaluations.is_open:
                commands += self._close_brood()
        while self._begun < min(self._brood_end, self.births + self._window):
            birth = BirthId(self._number, self._begun)
            candidate = self._conceived(birth, 0, None, "")
            self._unborn[self._begun] = _Unborn(candidate)
            self._begun += 1
            commands.append(Vet(birth, candidate.attempt, candidate.robot))
        return commands

    def _retry(self, candidate: Candidate, why: str) -> Vet:
        """Replace a candidate that cannot live by the next of its birth."""
        birth = candidate.birth
        following = self._conceived(birth, candidate.attempt + 1, candidate.couple, why)
        self._unborn[birth.number] = _Unborn(following)
        return Vet(birth, following.attempt, following.robot)

    def _conceived(
        self, birth: BirthId, attempt: int, couple: Couple | None, why: str
    ) -> Candidate:
        """Return the candidate of the first attempt, from this one, that gives one."""
        while True:
            couple, candidate = self._breeder.attempt(
                birth, attempt, self.population, couple, why
            )
            if candidate is not None:
                return candidate
            attempt += 1
            why = BARREN

    def _commit(
        self, candidate: Candidate, outcome: Evaluated | EvaluationFailed
    ) -> list[IslandCommand]:
        """Make a judged candidate an individual."""
        parents = candidate.couple or ()
        is_judged = isinstance(outcome, Evaluated)
        individual = Individual(
            candidate.birth,
            candidate.genome,
            outcome.evaluation.fitness if isinstance(outcome, Evaluated) else 0.0,
            1 + max((parent.rank for parent in parents), default=0),
            self._generation,
            has_failed=not is_judged,
        )
        del self._unborn[self.births]
        self._brood.append(individual)
        self.births += 1
        attempts = candidate.attempt + 1
        return [
            birth_record(individual, parents, attempts, candidate.robot, self._space),
            evaluation_record(outcome),
        ]

    def _close_brood(self) -> list[IslandCommand]:
        """Let the survivors be the population, and end the epoch if it is over."""
        parents, rows = self._reevaluations.conclude(self.population)
        last = BirthId(self._number, self.births - 1)
        self.population = self._survivor_selection.survivors(parents, self._brood, last)
        self._brood = []
        migrant_buffer = self._migrant_buffer
        if (
            migrant_buffer is None
            or self.is_finished
            or not migrant_buffer.is_due(self.births)
        ):
            return [*rows, *self._open_brood()]
        commands, self.population = migrant_buffer.depart(self.population, self.births)
        return [*rows, *commands, *self._land()]

    def _hear(self, event: MigrationEvent | Evaluated | EvaluationFailed) -> None:
        """Take news of neighbours, of immigrants, and of who is judged anew.

        For neighbours and immigrants nobody waits at the end.
        """
        if isinstance(event, Evaluated | EvaluationFailed) and event.requester is None:
            self._reevaluations.take(event)
            return
        if self._migrant_buffer is None:
            raise self._unexpected(event, "it has no neighbours")
        if not self.is_finished:
            self._migrant_buffer.take(event)

    def _land(self) -> list[IslandCommand]:
        """Let immigrants live here, once all are there that were waited for."""
        if self._migrant_buffer is None:
            return []
        commands, population = self._migrant_buffer.land(self.population, self.births)
        timed = [
            self._reevaluations.timed(each) if isinstance(each, Evaluate) else each
            for each in commands
        ]
        if population is None:
            return [*timed]
        self.population = population
        return [*timed, *self._open_brood()]

    def _open_brood(self) -> list[IslandCommand]:
        """Set out the next brood of the population that stands, or finish."""
        commands: list[IslandCommand] = []
        commands += population_records(self._number, self.births, self.population)
        if self.is_finished:
            neighbours = (
                () if self._migrant_buffer is None else self._migrant_buffer.neighbours
            )
            return [*commands, Finish(self._number, neighbours)]
        self._generation += 1
        self._window = self._experiment.window
        self._brood_end = self._survivor_selection.brood_end(
            self.births, len(self.population)
        )
        return commands
