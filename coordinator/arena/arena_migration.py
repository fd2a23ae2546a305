"""Migration of an arena: its emigrants, and immigrants until there is room for them."""

from msgspec.structs import replace

from coordinator.arena.living import LivingRobots, Moment, death_record
from coordinator.evolution.breeding import Individual
from coordinator.evolution.encodings import encoding_of
from coordinator.evolution.random_streams import Purpose
from coordinator.islands.events import Emigrate, Record
from coordinator.islands.migration import MigrationEpochs
from coordinator.islands.rows import migration_records
from schema.experiment.document import Experiment
from schema.robot.ids import BirthId


class ArenaMigration:
    """Emigrants and immigrants of one arena.

    A robot that is moved away leaves a place for an immigrant, which then replaces no
    other robot.

    Attributes:
        epochs: when the arena sends migrants, and what its neighbours sent.
        is_starving: no robot can be born any more, so the epoch ends early.
        is_extinct: the end of the epoch brought a starving arena no immigrant.
    """

    def __init__(
        self, experiment: Experiment, epochs: MigrationEpochs, living: LivingRobots
    ) -> None:
        assert experiment.arena is not None
        self.epochs = epochs
        self.is_starving = self.is_extinct = False
        self._births = experiment.births
        self._stay = experiment.selection.parents_needed
        self._develop = encoding_of(experiment).robot_of
        self._floor = experiment.arena.population_floor
        self._living = living
        self._queue: list[Individual] = []
        self._settled = 0
        self._vacancies = 0

    @property
    def may_bring_robots(self) -> bool:
        """An immigrant awaits room, or may come at the end of the epoch."""
        return bool(self._queue) or self.epochs.has_sources

    def exchange(self, moment: Moment) -> list[Record | Emigrate]:
        """Send migrants if they are due, and admit immigrants that have arrived."""
        commands: list[Record | Emigrate] = []
        if not self.epochs.is_waiting and moment.births < self._births:
            is_due = self.epochs.is_due(moment.births, moment.sim_time_s)
            if is_due or self.is_starving:
                commands += self._send(moment)
        if self.epochs.is_complete:
            has_arrivals = self._receive(moment)
            self.is_extinct = self.is_starving and not has_arrivals
            self.is_starving = False
        if not self.epochs.is_waiting and not self.is_extinct:
            commands += self._admit(moment)
        return commands

    def _send(self, moment: Moment) -> list[Record | Emigrate]:
        """End the epoch; return rows and migrants."""
        mature = self._living.mature()
        spare = len(mature) - self._stay
        sent, moved = self.epochs.send(mature, len(self._living), spare)
        self._vacancies += len(moved)
        return [
            *migration_records(sent, moment.births, moment.sim_time_s),
            *sent,
            *(self._removed(one, "migrated", moment) for one in moved),
        ]

    def _receive(self, moment: Moment) -> bool:
        """Begin the next epoch; return whether new immigrants await room."""
        known = {one.birth for one in [*self._living, *self._queue]}
        immigrants = [
            replace(one, fitness=0.0, has_failed=False)
            for one, _ in self.epochs.receive(known, moment.births, moment.sim_time_s)
        ]
        self._queue += immigrants
        return bool(immigrants)

    def _admit(self, moment: Moment) -> list[Record]:
        """Insert immigrants at random places; return the rows of replaced robots.

        No robot is replaced where the living are fewer than the population floor.
        """
        records = []
        while self._queue:
            replaced = None
            if not self._vacancies and len(self._living) >= self._floor:
                mature = self._living.mature()
                replaced = self.epochs.choose_replaced(mature, self._settled)
            if replaced is not None:
                records.append(self._removed(replaced, "replaced", moment))
            elif not self._living.room:
                break
            self._vacancies = max(0, self._vacancies - 1)
            self._settled += 1
            name = BirthId(moment.island, self._settled)
            place = self._living.random_place(name, Purpose.IMMIGRANT_PLACE)
            immigrant = self._queue.pop(0)
            robot = immigrant.learnt or self._develop(immigrant.genome)
            self._living.insert(immigrant, robot, place)
        return records

    def _removed(self, one: Individual, reason: str, moment: Moment) -> Record:
        return death_record(self._living.remove(one.birth), reason, moment)
