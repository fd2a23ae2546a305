"""Migration of an off-line island: its emigrants, and immigrants until they settle."""

from collections.abc import Iterable, Sequence

from coordinator.evolution.breeding import Breeder, Individual, failed_last
from coordinator.evolution.encodings import encoding_of
from coordinator.islands.events import Emigrate, MigrationEvent, Outcome, Record
from coordinator.islands.migration import MigrationEpochs
from coordinator.islands.rows import evaluation_record, migration_records
from schema.errors import UnexpectedEvent
from schema.experiment.document import Experiment
from schema.robot.ids import BirthId
from schema.wire.messages import Evaluate


class IslandMigration:
    """Emigrants and immigrants of one island; ``epochs``: when, and what has come.

    All immigrants of an epoch settle together, after the last of their re-evaluations.
    An immigrant that lives on the island already, as the original or as a copy, is
    dropped.
    """

    def __init__(
        self, experiment: Experiment, epochs: MigrationEpochs, breeder: Breeder
    ) -> None:
        selection, migration = experiment.selection, experiment.migration
        assert migration is not None
        self._breeder = breeder if migration.replaced == "rule" else None
        self.epochs = epochs
        self._labels = experiment.measures.labels
        self._develop = encoding_of(experiment).robot_of
        rules = selection.culling
        self._limit = rules.population_limit if rules else selection.population
        self._stay = selection.parents_needed
        self._settled = 0
        self._immigrants: dict[BirthId, Individual] | None = None
        self._outcomes: dict[BirthId, Outcome | None] = {}

    def send(
        self, population: Sequence[Individual], births: int
    ) -> tuple[list[Record | Emigrate], tuple[Individual, ...]]:
        """End the epoch; return rows and migrants, and the remaining population."""
        living = len(population)
        sent, moved = self.epochs.send(population, living, living - self._stay)
        rows = migration_records(sent, births)
        return [*rows, *sent], tuple(one for one in population if one not in moved)

    def take(self, event: MigrationEvent | Outcome) -> None:
        """Store an event until ``receive``; duplicate evaluations are ignored.

        Raises:
            UnexpectedEvent: the event is impossible now; nothing has changed.
        """
        if not isinstance(event, Outcome):
            self.epochs.take(event)
            return
        epoch = self.epochs.epoch
        is_known = event.trial < epoch or event.birth in self._outcomes
        is_own = event.requester == self.epochs.island
        if not is_own or event.trial > epoch or not is_known:
            raise UnexpectedEvent(
                f"island {self.epochs.island} awaits evaluations {epoch} of "
                f"{list(self._outcomes)}, got {event}"
            )
        if event.trial == epoch and self._outcomes[event.birth] is None:
            self._outcomes[event.birth] = event

    def receive(
        self, population: Sequence[Individual], births: int
    ) -> tuple[list[Evaluate | Record], tuple[Individual, ...] | None]:
        """Receive the immigrants of the epoch if all neighbours have sent theirs.

        Return evaluations to do and rows; and the new population once all immigrants
        have settled, None before.
        """
        commands: list[Evaluate | Record] = []
        if self.epochs.is_complete:
            commands += self._arrive(population, births)
        if self._immigrants is None or None in self._outcomes.values():
            return commands, None
        for birth, outcome in self._outcomes.items():
            assert outcome is not None
            immigrant = self._immigrants[birth]
            self._immigrants[birth] = immigrant.evaluated(
                outcome.evaluation, self._labels
            )
            commands.append(evaluation_record(outcome, self._labels))
        settled = self._settle(population, self._immigrants.values())
        self._immigrants, self._outcomes = None, {}
        return commands, settled

    def _arrive(self, population: Sequence[Individual], births: int) -> list[Evaluate]:
        """Begin the next epoch; return the re-evaluations of its immigrants."""
        living = {one.birth for one in population}
        arrivals = self.epochs.receive(living, births)
        self._immigrants = {one.birth: one for one, _ in arrivals}
        evaluations = [
            Evaluate(
                one.birth,
                one.learnt or self._develop(one.genome),
                self.epochs.epoch,
                requester=self.epochs.island,
            )
            for one, is_reevaluated in arrivals
            if is_reevaluated
        ]
        self._outcomes = {each.birth: None for each in evaluations}
        return evaluations

    def _settle(
        self, population: Sequence[Individual], immigrants: Iterable[Individual]
    ) -> tuple[Individual, ...]:
        """Return the population with all immigrants that the island has room for."""
        if self._breeder is not None:
            arrived = sorted(immigrants, key=lambda one: one.birth)
            epoch = BirthId(self.epochs.island, self.epochs.epoch)
            return self._breeder.settle([*population, *arrived], epoch)
        natives, settled = list(population), list[Individual]()
        for immigrant in immigrants:
            if len(natives) + len(settled) >= self._limit:
                replaced = self.epochs.choose_replaced(natives, self._settled)
                if replaced is None:
                    continue
                natives.remove(replaced)
            self._settled += 1
            settled.append(immigrant)
        everyone = failed_last([*natives, *settled])
        return tuple(sorted(everyone, key=lambda one: one.birth))
