"""On-line island: state machine of births, deaths and migration in one world.

A worker advances the world from one decision to the next. At each decision the arena
samples, begins a birth, culls, and inserts viable robots. Simulated time stops during
breeding, and while a learner is asked. The founders are inserted before all that, one
by one, in reverse order of their generation. Source: Hupkes 2016, section 5.3.3; the
code of the original.
"""

from collections.abc import Callable, Sequence
from typing import Any

from msgspec.structs import replace

from coordinator.arena.arena_migration import ArenaMigration
from coordinator.arena.candidates import BreedingQueue
from coordinator.arena.decisions import ArenaDecisions, matings_of
from coordinator.arena.infancy import Infancy
from coordinator.arena.living import (
    NO_WISH,
    LivingRobots,
    Moment,
    death_record,
    pair_records,
)
from coordinator.arena.orders import Orders, inserted
from coordinator.evolution.breeding import Breeder, Candidate, Individual
from coordinator.evolution.encodings import encoding_of
from coordinator.evolution.founders import Founder
from coordinator.islands.events import (
    Advanced,
    Append,
    ArenaCommand,
    ArenaEvent,
    Ask,
    Asked,
    Commanded,
    Finish,
    Immigrated,
    MigrationEvent,
    NeighbourClosed,
    Record,
    Started,
)
from coordinator.islands.migration import MigrationEpochs
from coordinator.islands.rows import ArchiveRows
from schema.errors import ExperimentError, UnexpectedEvent
from schema.experiment.document import Experiment, steps_of
from schema.plugins.arena_rules import Conception, Decisions, Place
from schema.wire.arena import AdvanceShard
from schema.wire.messages import Bred


class Arena:
    """One world and its living robots.

    Attributes:
        experiment: its settings.
        encoding: of its robots.
        clock: its intervals.
        births: number of births, founders included.
        living: its living robots; only the arena changes them.
        step: physics step of the last decision.
        is_finished: all births of the experiment are done, or ``is_extinct``.
        is_extinct: no robot can be born any more, and none can arrive.
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
        """Initialise an arena before its first event; arguments as in ``Island``.

        Raises:
            ExperimentError: the experiment is off-line.
        """
        arena = experiment.arena
        if arena is None:
            raise ExperimentError(f"{experiment.name}: has no [arena]")
        self.births = 0
        self.step = 0
        self.is_finished = self.is_extinct = False
        self.experiment = experiment
        self.epochs = epochs
        self._end_s = arena.end_s
        self.clock = ArenaClock(experiment)
        self.encoding = encoding_of(experiment)
        self._number = number
        self._breeder = Breeder(experiment, seed, run, given)
        self._breeding_queue = BreedingQueue(experiment, self._breeder, number)
        self._rules = ArenaDecisions(experiment, number, seed=seed, run=run)
        self.living = LivingRobots(
            arena,
            experiment.measures.labels,
            seed=seed,
            run=run,
            stores=self._rules.rules.stores,
            has_work=self._rules.needs_tracks,
        )
        learning = experiment.learning
        self._infancy = (
            Infancy(experiment, self.encoding, self.living)
            if learning and learning.budget > 1
            else None
        )
        self._orders = Orders(experiment, self.living, self._infancy)
        self._migration = (
            None if epochs is None else ArenaMigration(experiment, epochs, self.living)
        )
        if epochs:
            epochs.emigrants = self._breeder.emigrants
        self._archive_rows = ArchiveRows(number)
        self._founders: list[Candidate] = []
        self._advances = 0
        self._awaited: AdvanceShard | None = None
        self._has_started = self._is_held = False
        self._handlers: dict[type, Callable[[Any], list[ArenaCommand]]] = {
            Started: self._started,
            Bred: self._bred,
            Advanced: self._advanced,
            Commanded: self._commanded,
            Asked: self._asked,
            Immigrated: self._migrated,
            NeighbourClosed: self._migrated,
        }

    @property
    def population(self) -> tuple[Individual, ...]:
        """Living individuals by birth id, each with its last fitness."""
        return tuple(one.individual for one in self.living)

    @property
    def judged(self) -> tuple[Individual, ...]:
        """Living individuals whose fitness counts: the mature."""
        return self.living.mature()

    @property
    def is_paused(self) -> bool:
        """An operator has paused the arena."""
        return self._orders.is_paused

    @property
    def next_step(self) -> int:
        """Step at which an order that arrives now takes effect."""
        return self.step if self._awaited is None else self._awaited.until

    def handle(self, event: ArenaEvent) -> list[ArenaCommand]:
        """Handle an event and return the commands that follow from it.

        Duplicate answers and orders are ignored.

        Raises:
            UnexpectedEvent: the event is impossible now; nothing has changed.
            InvalidRobot: an order is invalid; nothing has changed.
            ExperimentError: no robot meets the restrictions; the arena cannot
                continue.
        """
        if isinstance(event, Started) == self._has_started:
            why = "it has started before" if self._has_started else "it has not started"
            raise self._unexpected(event, why)
        return self._handlers[type(event)](event)

    def _started(self, _event: Started) -> list[ArenaCommand]:
        self._has_started = True
        return [*self._breeding_queue.begin_founders()]

    def _bred(self, event: Bred) -> list[ArenaCommand]:
        was_busy = self._breeding_queue.is_busy
        requests = self._breeding_queue.take(event)
        if not was_busy or self._breeding_queue.is_busy:
            return [*requests]
        if self.births:
            return [*self._bear(), *self._conclude()]
        self._founders = self._breeding_queue.take_viable()
        return self._decide()

    def _asked(self, event: Asked) -> list[ArenaCommand]:
        """Take what a learner wants to try; duplicates are ignored."""
        birth = event.birth
        if self._infancy is None:
            raise self._unexpected(event, "it has no learners")
        if birth.island != self._number or not self._breeding_queue.has_taken(birth):
            raise self._unexpected(event, "no such robot has been born")
        is_new = self._infancy.take(event, self.step)
        if not is_new or self._infancy.is_waiting or self._breeding_queue.is_busy:
            return []
        return self._conclude()

    def _is_awaited(self, event: Advanced) -> bool:
        """Return whether an advance is the requested one; False for an old one.

        Raises:
            UnexpectedEvent: neither, or an impossible result.
        """
        if event.island == self._number and 0 <= event.number < self._advances:
            return False
        awaited, advance = self._awaited, event.advance
        if awaited is None or event.island != self._number:
            raise self._unexpected(event, "no such advance is awaited")
        if (event.number, advance.step) != (awaited.number, awaited.until):
            raise self._unexpected(
                event, f"advance {awaited.number} to {awaited.until} is awaited"
            )
        if why := self.living.mismatch(advance):
            raise self._unexpected(event, why)
        return True

    def _advanced(self, event: Advanced) -> list[ArenaCommand]:
        if not self._is_awaited(event):
            return []
        advance = event.advance
        over_s = self.clock.seconds(advance.step - self.step)
        self._awaited = None
        self._advances += 1
        self.step = advance.step
        commands: list[ArenaCommand] = []
        if event.pose_rows:
            commands.append(Append(event))
        commands += pair_records("touches", advance.touches, self._moment, over_s)
        for casualty in advance.casualties:
            died_s = self.clock.seconds(casualty.step)
            moment = self._moment._replace(sim_time_s=died_s)
            commands.append(death_record(casualty, "diverged", moment))
        self.living.update(advance)
        self._rules.note(advance)
        if self._infancy is not None:
            commands += self._infancy.end_trials(event, self._moment)
        return commands + self._decide()

    def _decide(self) -> list[ArenaCommand]:
        """Do what is due at this step, up to the next breeding."""
        commands: list[ArenaCommand] = []
        if self._founders:
            if self.step % self.clock.founder == 0:
                commands += self._insert(self._founders.pop())
            return commands + self._conclude()
        if matured := self.living.take_matured(self._number):
            commands += self._remember(matured)
        if self.step % self.clock.sample == 0:
            commands += self.living.sample(self._moment)
            commands += self._rules.sample(self._moment)
        if self.step % self.clock.birth == 0 or self.step % self.clock.cull == 0:
            commands += self._apply_rules()
        if self.is_finished or self._breeding_queue.is_busy:
            return commands
        return [*commands, *self._bear(), *self._conclude()]

    def _remember(self, matured: Sequence[Individual]) -> list[Record]:
        """Let rules of selection remember the mature; return the archive's new rows."""
        mature, moment = self.living.mature(), self._moment
        self._breeder.update(mature, matured)
        archive = self._breeder.archive(mature)
        return self._archive_rows.changes(archive, moment.births, moment.sim_time_s)

    def _apply_rules(self) -> list[ArenaCommand]:
        """Let the rules decide; end the run if it is over."""
        moment, births_are_due = self._moment, self.step % self.clock.birth == 0
        decisions, rows = self._rules.decide(
            self.living,
            moment,
            self.step,
            births=births_are_due,
            deaths=self.step % self.clock.cull == 0,
        )
        commands: list[ArenaCommand] = [*rows]
        if births_are_due and self._is_over(decisions):
            return [*commands, *self._finish()]
        matings = matings_of(decisions, self.living)
        for birth, stores in sorted(decisions.stores.items()):
            self.living.store(birth, stores)
        for death in decisions.deaths:
            commands += self._orders.end_infancy(death.birth, death.reason, moment)
            removed = self.living.remove(death.birth)
            commands.append(death_record(removed, death.reason, moment))
        room = min(self.living.room, self.experiment.births - self.births)
        return [*commands, *self._breeding_queue.begin_children(matings, room)]

    def _is_over(self, decisions: Decisions) -> bool:
        """Return whether the run ends here: extinct, all births done, or late."""
        self.is_extinct = not self._orders.prevent_extinction and (
            decisions.is_extinct or not (len(self.living) or decisions.births)
        )
        migration = self._migration
        if migration is not None:
            migration.is_starving = self.is_extinct and migration.may_bring_robots
            self.is_extinct = self.is_extinct and not migration.is_starving
        is_late = 0.0 < self._end_s <= self.clock.seconds(self.step)
        return self.is_extinct or is_late or self.births >= self.experiment.births

    def _bear(self) -> list[Record | Ask]:
        commands: list[Record | Ask] = []
        for mating, child, outcome in self._breeding_queue.take_children():
            if child is not None:
                commands += self._insert(child, wish=mating.wish)
            commands += self._rules.end_mating(mating, child, outcome, self._moment)
        return commands

    def _conclude(self) -> list[ArenaCommand]:
        commands: list[ArenaCommand] = []
        orders = self._orders
        if orders.pending:
            commands += orders.carry_out(self._moment)
        while orders.insertions and not self._founders and self.living.room:
            order = orders.insertions.pop(0)
            birth = self._breeding_queue.take_number()
            commands += self._insert(inserted(order, birth, self.encoding), order.place)
        if self._infancy is not None and self._infancy.is_waiting:
            return commands
        if self._migration is not None and not self._founders:
            commands += self._migration.exchange(self._moment)
            if self._migration.epochs.is_waiting:
                return commands
            if self._migration.is_extinct:
                self.is_extinct = True
                return [*commands, *self._finish()]
        self._is_held = orders.is_paused
        if not self._is_held:
            commands.append(self._advance())
        return commands

    def _finish(self) -> list[Record | Finish]:
        self.is_finished = True
        links = self._migration.epochs.links.neighbours if self._migration else ()
        trials = self._infancy.close() if self._infancy is not None else []
        return [*trials, Finish(self._number, links)]

    def _migrated(self, event: MigrationEvent) -> list[ArenaCommand]:
        """Handle an event of a neighbour; a finished arena ignores it."""
        if self._migration is None:
            raise self._unexpected(event, "it has no neighbours")
        if self.is_finished:
            return []
        self._migration.epochs.take(event)
        return self._conclude() if self._migration.epochs.is_complete else []

    def _commanded(self, event: Commanded) -> list[ArenaCommand]:
        """Store an order until the next decision; carry it out now if paused."""
        if event.command_id in self._orders.ids or self.is_finished:
            return []
        if (event.island, event.step) != (self._number, self.next_step):
            raise self._unexpected(event, f"orders take effect at {self.next_step}")
        self._orders.take(event)
        return self._conclude() if self._is_held else []

    def _advance(self) -> AdvanceShard:
        clock, step = self.clock, self.step
        until = clock.next_decision(step, is_founding=bool(self._founders))
        if self._infancy is not None:
            until = self._infancy.next_end(until)
        changes = replace(self.living.take_changes(), lights=self._rules.lights)
        is_saved = until // clock.snapshot > step // clock.snapshot
        self._awaited = AdvanceShard(
            self._number,
            self._advances,
            until,
            changes,
            is_saved,
            wants_tracks=self._rules.needs_tracks,
        )
        return self._awaited

    def _insert(
        self,
        candidate: Candidate,
        place: Place | None = None,
        wish: Conception = NO_WISH,
    ) -> list[Record | Ask]:
        """Insert a robot at a place, random as wished if None.

        Returns:
            The rows of its birth; the first request to its learner if it learns.
        """
        self.births += 1
        rows = self.living.add_newborn(
            candidate, self.encoding, self._moment, place, wish
        )
        if self._infancy is None:
            return [*rows]
        return [*rows, *self._infancy.begin(candidate, self.step)]

    @property
    def _moment(self) -> Moment:
        return Moment(self._number, self.births, self.clock.seconds(self.step))

    def _unexpected(self, event: ArenaEvent, why: str) -> UnexpectedEvent:
        return UnexpectedEvent(
            f"arena {self._number} at step {self.step}, {self.births} of "
            f"{self.experiment.births} born, {len(self.living)} alive, "
            f"{self._advances} advances done: {why}, got {event}"
        )


class ArenaClock:
    """Intervals of an arena; every decision falls on a multiple of one of them.

    Attributes:
        founder, birth, cull, sample, snapshot: intervals [steps].
    """

    def __init__(self, experiment: Experiment) -> None:
        rules, simulation = experiment.arena, experiment.simulation
        assert rules is not None
        self._timestep_s = simulation.timestep_s
        self.founder = steps_of(rules.founder_interval_s, simulation)
        self.birth = steps_of(rules.birth_interval_s, simulation)
        self.cull = steps_of(rules.cull_interval_s, simulation)
        self.sample = steps_of(rules.sample_interval_s, simulation)
        self.snapshot = steps_of(rules.snapshot_interval_s, simulation)

    def seconds(self, step: int) -> float:
        """Return the simulated time of a step [s]."""
        return step * self._timestep_s

    def next_decision(self, step: int, *, is_founding: bool) -> int:
        """Return the step of the next decision; while founding, of the next founder."""
        later = (self.birth, self.cull, self.sample)
        intervals = (self.founder,) if is_founding else later
        return min((step // each + 1) * each for each in intervals)
