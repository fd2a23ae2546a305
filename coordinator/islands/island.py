"""Off-line island: state machine of births, evaluations, selection and migration.

Founders come first, then broods of children of the population at the start of the
brood. Births of a brood are in flight together, up to the experiment's window. They
are committed in birth order, whatever the order of their answers.
Source: Hupkes 2016, section 5.3; the code of the original.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from math import isfinite
from typing import Any

from coordinator.evolution.breeding import Breeder, Candidate, Couple, Individual
from coordinator.evolution.encodings import encoding_of
from coordinator.evolution.founders import Founder
from coordinator.islands.events import (
    Answered,
    Asked,
    Evaluated,
    EvaluationFailed,
    Finish,
    Immigrated,
    IslandCommand,
    IslandEvent,
    MigrationEvent,
    NeighbourClosed,
    Outcome,
    Record,
    Started,
)
from coordinator.islands.island_migration import IslandMigration
from coordinator.islands.learning import IslandLearning, NewbornLearning
from coordinator.islands.migration import MigrationEpochs
from coordinator.islands.reevaluation import (
    Reevaluations,
    with_durations,
    with_points,
)
from coordinator.islands.rows import (
    ArchiveRows,
    birth_record,
    evaluation_record,
    population_records,
)
from schema.errors import UnexpectedEvent
from schema.experiment.document import Experiment
from schema.robot.ids import BirthId
from schema.wire.messages import Bred, Breed, Evaluate


@dataclass(slots=True)
class _Birth:
    """Birth in flight: request, parents, viable candidate, evaluation, trials."""

    request: Breed
    couple: Couple | None
    candidate: Candidate | None = None
    outcome: Outcome | None = None
    learning: NewbornLearning | None = None


class Island:
    """One population and its births.

    Attributes:
        births: number of recorded births.
        population: living individuals, in birth order.
        epochs: its migration; None without neighbours.
    """

    def __init__(
        self,
        experiment: Experiment,
        seed: int,
        run: int,
        number: int = 0,
        *,
        epochs: MigrationEpochs | None = None,
        given: Sequence[Founder] = (),
    ) -> None:
        """Initialise an island, which has a number in its run, before its first event.

        ``given`` are founders of the first births, of which the others are random.
        """
        selection = experiment.selection
        self.births = 0
        self.population: tuple[Individual, ...] = ()
        self.experiment = experiment
        self.epochs = epochs
        self._labels = experiment.measures.labels
        self._seed, self._run, self._number = seed, run, number
        self._encoding = encoding_of(experiment)
        self._breeder = Breeder(experiment, seed, run, given)
        self._reevaluations = (
            Reevaluations(experiment, number) if selection.reevaluation else None
        )
        self._learning = (
            IslandLearning(experiment, self._encoding) if experiment.learning else None
        )
        self._migration = (
            IslandMigration(experiment, epochs, self._breeder) if epochs else None
        )
        if epochs:
            epochs.emigrants = self._breeder.emigrants
        self._archive_rows = ArchiveRows(number)
        self._generation = 0
        self._begun = 0
        # Founders have no parents: all of them are in flight together.
        self._window = self._brood_end = selection.population
        self._brood_window = experiment.window
        self._in_flight: dict[int, _Birth] = {}
        self._handlers: dict[type, Callable[[Any], list[IslandCommand]]] = {
            Started: self._started,
            Bred: self._bred,
            Evaluated: self._evaluated,
            EvaluationFailed: self._evaluated,
            Asked: self._learnt,
            Immigrated: self._migrated,
            NeighbourClosed: self._migrated,
        }
        self._brood: list[Individual] = []

    @property
    def judged(self) -> tuple[Individual, ...]:
        """Living individuals whose fitness is known."""
        return tuple(one for one in self.population if not one.has_failed)

    @property
    def is_finished(self) -> bool:
        """All births of the experiment are recorded, and no re-evaluation is open."""
        return self.births == self.experiment.births and not (
            self._reevaluations and self._reevaluations.is_open
        )

    def handle(self, event: IslandEvent) -> list[IslandCommand]:
        """Handle an event and return the commands that follow from it.

        Duplicate answers are ignored.

        Raises:
            UnexpectedEvent: the event is impossible now; nothing has changed.
            ExperimentError: no robot meets the restrictions; the island cannot
                continue.
        """
        commands = self._handlers[type(event)](event)
        if self.experiment.changes:
            learns = self._learning is not None
            commands = with_points(commands, self.births, learns=learns)
        simulation = self.experiment.simulation
        if simulation.evaluation_s is None:
            return commands
        return with_durations(commands, simulation, self._seed, self._run)

    def _started(self, event: Started) -> list[IslandCommand]:
        if self._begun:
            raise self._unexpected(event, "it has started before")
        return self._proceed()

    def _bred(self, event: Bred) -> list[IslandCommand]:
        newborn = self._newborn(event)
        if newborn is None:
            return []
        request = newborn.request
        if event.attempt > request.attempt:
            raise self._unexpected(event, f"it is at attempt {request.attempt}")
        if event.attempt < request.attempt or newborn.candidate is not None:
            return []
        candidate = self._breeder.candidate(event, newborn.couple)
        if candidate is None:
            return [self._begin(event.birth, request.end, event.why)]
        newborn.candidate = candidate
        if self._learning is None:
            return [Evaluate(candidate.birth, candidate.robot)]
        newborn.learning = NewbornLearning(candidate, self._learning, self.population)
        return [*newborn.learning.start()]

    def _evaluated(self, event: Outcome) -> list[IslandCommand]:
        """Handle an evaluation of a newborn, a parent or an immigrant."""
        if event.evaluation and not isfinite(event.evaluation.fitness):
            raise self._unexpected(event, "fitness must be finite")
        if event.requester is not None:
            return self._migrated(event)
        if self._learning is not None:
            return self._learnt(event)
        if event.trial:
            if self._reevaluations is None:
                raise self._unexpected(event, "it re-evaluates no robot")
            self._reevaluations.take(event)
        elif newborn := self._newborn(event):
            newborn.outcome = event
        return self._proceed()

    def _learnt(self, event: Outcome | Asked) -> list[IslandCommand]:
        """Handle a trial of a newborn, or the answer of its learner."""
        newborn = self._newborn(event)
        if newborn is None:
            return []
        if newborn.learning is None:
            raise self._unexpected(event, "it has no learners")
        commands = newborn.learning.take(event)
        if not newborn.learning.is_done:
            return [*commands]
        newborn.candidate, newborn.outcome = newborn.learning.conclude()
        return self._proceed()

    def _newborn(self, event: Answered) -> _Birth | None:
        """Return the birth that an answer belongs to; None if it has its outcome."""
        birth = event.birth
        if birth.island != self._number or not 0 <= birth.number < self._begun:
            raise self._unexpected(event, f"births 0..{self._begun - 1} have begun")
        newborn = self._in_flight.get(birth.number)
        if newborn is None or newborn.outcome is not None:
            return None
        if newborn.candidate is None and not isinstance(event, Bred):
            raise self._unexpected(event, "it has not been bred")
        return newborn

    def _unexpected(self, event: IslandEvent, why: str) -> UnexpectedEvent:
        return UnexpectedEvent(
            f"island {self._number}, {self.births} of {self.experiment.births} born, "
            f"{self._begun} begun, brood {self._generation} ends at "
            f"{self._brood_end}: {why}, got {event}"
        )

    def _proceed(self) -> list[IslandCommand]:
        """Commit evaluated births in order, and begin births up to the window."""
        commands: list[IslandCommand] = []
        while (first := self._in_flight.get(self.births)) and first.outcome:
            commands += self._commit(first, first.outcome)
        if self.births == self._brood_end and self._brood:
            reevaluations = self._reevaluations
            if reevaluations is not None:
                commands += reevaluations.start(self.births, self.population)
            if reevaluations is None or not reevaluations.is_open:
                commands += self._close_brood()
        while self._begun < min(self._brood_end, self.births + self._window):
            self._begun += 1
            commands.append(self._begin(BirthId(self._number, self._begun - 1)))
        return commands

    def _begin(self, birth: BirthId, attempt: int = 0, why: str = "") -> Breed:
        """Begin a birth, or go on with new parents; as ``Breeder.request``."""
        begun = self._breeder.request(birth, attempt, self.population, why)
        self._in_flight[birth.number] = _Birth(*begun)
        return begun[0]

    def _commit(self, newborn: _Birth, outcome: Outcome) -> list[IslandCommand]:
        """Add an evaluated candidate to the brood; return its rows."""
        del self._in_flight[self.births]
        candidate = newborn.candidate
        assert candidate is not None
        individual = candidate.individual(self._generation).evaluated(
            outcome.evaluation, self._labels
        )
        self._brood.append(individual)
        self.births += 1
        born = birth_record(candidate, individual, self._encoding)
        trials = newborn.learning.records() if newborn.learning else ()
        return [born, evaluation_record(outcome, self._labels), *trials]

    def _close_brood(self) -> list[IslandCommand]:
        """Select the survivors, and end the epoch of migration if it is due.

        Rules with a memory take the brood in between.
        """
        parents, rows = self.population, list[Record]()
        if self._reevaluations is not None:
            parents, rows = self._reevaluations.conclude(parents)
        self.population = self._breeder.survivors(parents, self._brood)
        self._breeder.update(parents, self._brood)
        self._brood = []
        migration = self._migration
        if (
            migration is None
            or self.is_finished
            or not migration.epochs.is_due(self.births)
        ):
            return [*rows, *self._open_brood()]
        commands, self.population = migration.send(self.population, self.births)
        return [*rows, *commands, *self._receive(migration)]

    def _migrated(self, event: MigrationEvent | Outcome) -> list[IslandCommand]:
        """Handle an event of a neighbour or the re-evaluation of an immigrant.

        A finished island ignores it.
        """
        if self._migration is None:
            raise self._unexpected(event, "it has no neighbours")
        if self.is_finished:
            return []
        self._migration.take(event)
        return [*self._receive(self._migration), *self._proceed()]

    def _receive(self, migration: IslandMigration) -> list[IslandCommand]:
        """Settle the immigrants of the epoch once all of them can settle."""
        commands, population = migration.receive(self.population, self.births)
        if population is None:
            return [*commands]
        self.population = population
        return [*commands, *self._open_brood()]

    def _open_brood(self) -> list[IslandCommand]:
        commands: list[IslandCommand] = []
        fitness = [(one.birth, one.known_fitness) for one in self.population]
        commands += population_records(self._number, self.births, fitness)
        archive = self._breeder.archive(self.population)
        commands += self._archive_rows.changes(archive, self.births)
        if self.is_finished:
            migration = self._migration
            neighbours = migration.epochs.links.neighbours if migration else ()
            return [*commands, Finish(self._number, neighbours)]
        selection = self.experiment.selection
        children = selection.children
        if selection.culling is not None:
            # A brood keeps within the population limit, but has at least one child.
            room = selection.culling.population_limit - len(self.population)
            children = min(children, max(1, room))
        self._generation += 1
        self._window = self._brood_window
        self._brood_end = min(self.births + children, self.experiment.births)
        return commands
