"""The harbour of an off-line island: who leaves at the end of an epoch, who lands.

Everybody who comes in one epoch, and must be judged anew, is judged before any of
them settles. Who lives on the island already, be it the original or a copy that
came before, is turned away.
"""

from collections.abc import Sequence
from dataclasses import replace
from math import isfinite

from coordinator.evolution.selection import Individual
from coordinator.islands.events import (
    Emigrate,
    Evaluate,
    Evaluated,
    EvaluationFailed,
    MigrationEvent,
    Record,
)
from coordinator.islands.migration import MigrationEpochs
from coordinator.islands.rows import evaluation_record, migration_records
from schema.errors import UnexpectedEvent
from schema.experiment.document import Experiment, body_space
from schema.robot.genome import develop
from schema.robot.ids import BirthId

Outcome = Evaluated | EvaluationFailed


class MigrantBuffer:
    """Those who leave an island and those who come."""

    def __init__(
        self, experiment: Experiment, number: int, epochs: MigrationEpochs
    ) -> None:
        """Expect nobody on an island."""
        self._space = body_space(experiment.space)
        culling = experiment.selection.culling
        self._size = (
            experiment.selection.population
            if culling is None
            else culling.population_limit
        )
        self._stay = experiment.selection.parents_needed
        self._number = number
        self._epochs = epochs
        self._settled = 0
        self._guests: dict[BirthId, Individual] = {}
        self._awaited: dict[BirthId, Outcome | None] = {}
        self._is_immigrating = False

    @property
    def neighbours(self) -> tuple[int, ...]:
        """Whom the island is connected with."""
        return self._epochs.links.neighbours

    def is_due(self, births: int) -> bool:
        """Return whether an epoch ends with so many births."""
        return self._epochs.is_due(births)

    def depart(
        self, population: Sequence[Individual], births: int
    ) -> tuple[list[Record | Emigrate], tuple[Individual, ...]]:
        """End the epoch; return what follows, and who is left."""
        living = len(population)
        sent, gone = self._epochs.leave(population, living, living - self._stay)
        rows = migration_records(sent, births)
        left = tuple(one for one in population if one not in gone)
        return [*rows, *sent], left

    def take(self, event: MigrationEvent | Outcome) -> None:
        """Keep what came until ``land``; old judgements are ignored.

        Raises:
            UnexpectedEvent: it cannot come; nothing has changed.
        """
        if not isinstance(event, Evaluated | EvaluationFailed):
            self._epochs.take(event)
            return
        epoch = self._epochs.epoch
        is_known = event.trial < epoch or event.birth in self._awaited
        if event.requester != self._number or event.trial > epoch or not is_known:
            raise UnexpectedEvent(
                f"island {self._number} awaits judgements {epoch} of "
                f"{list(self._awaited)}, got {event}"
            )
        if isinstance(event, Evaluated) and not isfinite(event.evaluation.fitness):
            raise UnexpectedEvent(f"fitness must be finite, got {event}")
        if event.trial == epoch and self._awaited[event.birth] is None:
            self._awaited[event.birth] = event

    def land(
        self, population: Sequence[Individual], births: int
    ) -> tuple[list[Evaluate | Record], tuple[Individual, ...] | None]:
        """Return what follows, and the new population once all have settled."""
        commands: list[Evaluate | Record] = []
        if self._epochs.is_complete:
            commands += self._welcome(population, births)
        if not self._is_immigrating or None in self._awaited.values():
            return commands, None
        for birth, outcome in self._awaited.items():
            assert outcome is not None
            self._guests[birth] = _judged(self._guests[birth], outcome)
            commands.append(evaluation_record(outcome))
        self._is_immigrating = False
        return commands, self._settle(population)

    def _welcome(self, population: Sequence[Individual], births: int) -> list[Evaluate]:
        """Take in who came; return whom to judge."""
        arrivals = self._epochs.arrive(births)
        living = {one.birth for one in population}
        news = [(one, anew) for one, anew in arrivals if one.birth not in living]
        self._is_immigrating = True
        self._guests = {one.birth: one for one, _ in news}
        self._awaited = {one.birth: None for one, is_anew in news if is_anew}
        trial = self._epochs.epoch
        return [
            Evaluate(
                birth,
                develop(self._guests[birth].genome, self._space),
                trial,
                requester=self._number,
            )
            for birth in self._awaited
        ]

    def _settle(self, population: Sequence[Individual]) -> tuple[Individual, ...]:
        """Return the population in which all guests live who found room."""
        living_robots, settled = list(population), list[Individual]()
        for guest in self._guests.values():
            if len(living_robots) + len(settled) >= self._size:
                gone = self._epochs.place_for(living_robots, self._settled)
                if gone is None:
                    continue
                living_robots.remove(gone)
            self._settled += 1
            settled.append(guest)
        self._guests, self._awaited = {}, {}
        return tuple(sorted([*living_robots, *settled], key=lambda one: one.birth))


def _judged(guest: Individual, outcome: Outcome) -> Individual:
    """Return an immigrant with the fitness that it has here."""
    if isinstance(outcome, EvaluationFailed):
        return replace(guest, fitness=0.0, has_failed=True)
    return replace(guest, fitness=outcome.evaluation.fitness, has_failed=False)
