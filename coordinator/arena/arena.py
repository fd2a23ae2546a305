"""An on-line island: robots are born, judged all the time and die in one world.

A pure machine. Whoever holds its shard advances it from one decision to the next;
at each the machine samples, begins a birth, culls, and then inserts whom it may.
Time stands still while the analyzer is asked. First come the founders, one by one,
the last made first, and nothing else happens until all of them are in.
Source: Hupkes 2016, section 5.3.3; facts of the original, section 5.2.
"""

from math import isfinite

from coordinator.arena.arena_migration import ImmigrantQueue
from coordinator.arena.candidates import VettingQueue
from coordinator.arena.changes import PendingChanges
from coordinator.arena.clock import ArenaClock
from coordinator.arena.living import LivingRobot, LivingRobots
from coordinator.arena.orders import check_order, guest, rewired
from coordinator.arena.place import Place, draw_place
from coordinator.arena.rows import (
    casualty_record,
    death_record,
    living_records,
    sample_records,
    touch_records,
)
from coordinator.evolution.breeding import Breeder, Candidate
from coordinator.evolution.culling import select_culled
from coordinator.evolution.random_streams import BufferedRng, Purpose, stream
from coordinator.evolution.selection import Couple, Individual
from coordinator.islands.events import (
    Advanced,
    AdvanceShard,
    Append,
    ArenaCommand,
    ArenaEvent,
    Commanded,
    Finish,
    Immigrated,
    Insert,
    NeighbourClosed,
    Order,
    Pause,
    Record,
    Remove,
    ReplaceBrain,
    Resume,
    Started,
    Vet,
    Vetted,
    VettingFailed,
)
from coordinator.islands.migration import MigrationEpochs
from coordinator.islands.rows import birth_record, migration_records
from schema.errors import ExperimentError, UnexpectedEvent
from schema.experiment.document import Experiment, body_space
from schema.robot.genome import develop
from schema.robot.ids import BirthId
from schema.robot.robot import Robot


class Arena:
    """One world and who lives in it.

    Attributes:
        births: how many individuals have been born, founders included.
        step: of the last decision, in physics steps.
        is_finished: all births of the experiment have been, or ``is_extinct``.
        is_extinct: too few are left to mate, and nobody will come.
        is_paused: an operator wants it to stand still.
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
        """Make an arena in which nothing has happened.

        Args:
            experiment: what is evolved, and how.
            seed: of the experiment's execution.
            run: number of the repeat, from 0.
            number: of this island.
            epochs: its side of migration; None if it has no neighbours.

        Raises:
            ExperimentError: the experiment is off-line.
        """
        if experiment.arena is None:
            raise ExperimentError(f"{experiment.name}: has no [arena]")
        self.births = 0
        self.step = 0
        self.is_finished = self.is_extinct = self.is_paused = False
        self._experiment = experiment
        self._rules = experiment.arena
        self._clock = ArenaClock.of(experiment.arena, experiment.simulation)
        self._space = body_space(experiment.space)
        self._seed, self._run, self._number = seed, run, number
        attempts = experiment.selection.max_mating_attempts
        self._vetting_queue = VettingQueue(
            Breeder(experiment, seed, run), number, attempts
        )
        self._living = LivingRobots()
        self._pending = PendingChanges()
        self._founders: list[Candidate] = []
        self._guests: list[Insert] = []
        self._orders: list[Order] = []
        self._order_ids: set[str] = set()
        self._advances = 0
        self._awaited: AdvanceShard | None = None
        self._has_started = self._is_held = self._is_starving = False
        self._immigrant_queue = None if epochs is None else ImmigrantQueue(epochs)

    @property
    def population(self) -> tuple[Individual, ...]:
        """The living by name, each with its last fitness."""
        return tuple(one.individual for one in self._living)

    @property
    def judged(self) -> tuple[Individual, ...]:
        """Those of the living whose fitness counts: the mature."""
        return self._living.mature()

    @property
    def next_step(self) -> int:
        """The step at which an order that comes now takes effect."""
        return self.step if self._awaited is None else self._awaited.until

    def handle(self, event: ArenaEvent) -> list[ArenaCommand]:
        """Take an event and return what follows from it.

        Duplicates of answers and orders that were taken before are ignored.

        Raises:
            UnexpectedEvent: an event that cannot come now; nothing has changed.
            InvalidRobot: an order that was not checked; nothing has changed.
            ExperimentError: restrictions that no robot meets; the arena cannot go
                on.
        """
        if isinstance(event, Started) == self._has_started:
            why = "it has started before" if self._has_started else "it has not started"
            raise self._unexpected(event, why)
        match event:
            case Started():
                self._has_started = True
                return [
                    *self._vetting_queue.found(self._experiment.selection.population)
                ]
            case Vetted() | VettingFailed():
                return self._judge(event)
            case Advanced():
                return self._arrive(event) if self._is_awaited(event) else []
            case Commanded():
                return self._obey(event)
            case Immigrated() | NeighbourClosed():
                return self._hear(event)

    def _judge(self, event: Vetted | VettingFailed) -> list[ArenaCommand]:
        was_busy = self._vetting_queue.is_busy
        vets = self._vetting_queue.judge(event)
        if not was_busy or self._vetting_queue.is_busy:
            return [*vets]
        if self.births:
            return self._conclude()
        viable = self._vetting_queue.viable
        self._founders = [viable.pop(number) for number in sorted(viable)]
        return self._decide()

    def _is_awaited(self, event: Advanced) -> bool:
        """Return whether an advance is the one that was asked for, or an old one.

        Raises:
            UnexpectedEvent: neither, or it cannot be what the advance came to.
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
        told = [one.birth for one in advance.judgements]
        told += [one.birth for one in advance.casualties]
        if sorted(told) != [one.birth for one in self._living]:
            raise self._unexpected(event, "it must tell of all living, each once")
        if not all(isfinite(one.fitness) for one in advance.judgements):
            raise self._unexpected(event, "fitness must be finite")
        return True

    def _arrive(self, event: Advanced) -> list[ArenaCommand]:
        """Take what an advance came to, and decide."""
        advance = event.advance
        now_s = self._clock.seconds(advance.step)
        over_s = self._clock.seconds(advance.step - self.step)
        self._awaited = None
        self._advances += 1
        self.step = advance.step
        commands: list[ArenaCommand] = []
        if event.pose_rows:
            commands.append(Append("poses", event.pose_rows, advance.poses))
        commands += touch_records(advance.touches, self._number, now_s, over_s)
        for casualty in advance.casualties:
            self._living.remove(casualty.birth)
            fell_s = self._clock.seconds(casualty.step)
            commands.append(
                casualty_record(casualty, self._number, self.births, fell_s)
            )
        self._living.judge(advance.judgements)
        return commands + self._decide()

    def _decide(self) -> list[ArenaCommand]:
        """Do what is due at this step, as far as nobody must be asked."""
        if self._founders:
            founder = self._founders.pop()
            return [*self._born(founder), *self._conclude()]
        commands: list[ArenaCommand] = []
        if self.step % self._clock.sample == 0:
            now_s = self._clock.seconds(self.step)
            commands += sample_records(self._living, self._number, self.births, now_s)
        if self.step % self._clock.birth == 0:
            immigrant_queue = self._immigrant_queue
            is_few = not self._guests and (
                len(self._living) < self._experiment.selection.parents_needed
            )
            self._is_starving = (
                is_few and immigrant_queue is not None and immigrant_queue.is_hopeful
            )
            self.is_extinct = is_few and not self._is_starving
            if self.is_extinct or self.births >= self._experiment.births:
                return [*commands, self._finish()]
            commands += self._mate()
        if self.step % self._clock.cull == 0:
            reason, culled = select_culled(self._living.mature(), self._rules)
            for one in culled:
                resident = self._living.remove(one.birth)
                commands.append(self._gone(resident, reason))
        return commands if self._vetting_queue.is_busy else commands + self._conclude()

    def _mate(self) -> list[Vet]:
        """Begin a birth, if there is room and there are parents (trap B12)."""
        mature = self._living.mature()
        is_full = len(self._living) >= self._rules.population_limit
        if is_full or len(mature) < self._experiment.selection.parents_needed:
            return []
        return self._vetting_queue.mate(mature)

    def _conclude(self) -> list[ArenaCommand]:
        """Insert who is viable, carry out orders, and go on unless paused."""
        commands: list[ArenaCommand] = []
        for number in sorted(self._vetting_queue.viable):
            commands += self._born(self._vetting_queue.viable.pop(number))
        orders, self._orders = self._orders, []
        for order in orders:
            commands += self._carry_out(order)
        while self._guests and not self._founders and self._has_room():
            order = self._guests.pop(0)
            individual, robot = guest(
                order, self._vetting_queue.take_number(), self._space
            )
            commands += self._insert(individual, robot, (), 1, order.place)
        if self._immigrant_queue is not None and not self._founders:
            commands += self._trade(self._immigrant_queue)
            if self._immigrant_queue.is_waiting or self.is_finished:
                return commands
        self._is_held = self.is_paused
        if not self.is_paused:
            commands.append(self._advance())
        return commands

    def _finish(self) -> Finish:
        self.is_finished = True
        neighbours = (
            () if self._immigrant_queue is None else self._immigrant_queue.neighbours
        )
        return Finish(self._number, neighbours)

    def _hear(self, event: Immigrated | NeighbourClosed) -> list[ArenaCommand]:
        """Take news of a neighbour, which may be the last that time stands for."""
        if self._immigrant_queue is None:
            raise self._unexpected(event, "it has no neighbours")
        if self.is_finished:
            return []
        self._immigrant_queue.take(event)
        return self._conclude() if self._immigrant_queue.is_complete else []

    def _trade(self, immigrant_queue: ImmigrantQueue) -> list[ArenaCommand]:
        """Send migrants if they are due; let those in who came, as room allows."""
        commands: list[ArenaCommand] = []
        now_s = self._clock.seconds(self.step)
        is_due = self._is_starving or immigrant_queue.is_due(self.births, now_s)
        if (
            is_due
            and not immigrant_queue.is_waiting
            and self.births < self._experiment.births
        ):
            mature = self._living.mature()
            stay = self._experiment.selection.parents_needed
            sent, gone = immigrant_queue.depart(mature, len(self._living), stay)
            commands += [*migration_records(sent, self.births, now_s), *sent]
            for one in gone:
                resident = self._living.remove(one.birth)
                commands.append(self._gone(resident, "migrated"))
        if immigrant_queue.is_complete:
            living = [one.birth for one in self._living]
            came = immigrant_queue.arrive(living, self.births, now_s)
            self.is_extinct = self._is_starving and not came
            self._is_starving = False
            if self.is_extinct:
                return [*commands, self._finish()]
        return (
            commands
            if immigrant_queue.is_waiting
            else commands + self._admit(immigrant_queue)
        )

    def _admit(self, immigrant_queue: ImmigrantQueue) -> list[ArenaCommand]:
        """Let immigrants in, each at a place of chance.

        Nobody makes room where the living are few.
        """
        commands: list[ArenaCommand] = []
        while True:
            is_few = len(self._living) < self._rules.population_floor
            mature = () if is_few else self._living.mature()
            found = immigrant_queue.next_in(mature, has_room=self._has_room())
            if found is None:
                return commands
            immigrant, replaced = found
            if replaced is not None:
                resident = self._living.remove(replaced.birth)
                commands.append(self._gone(resident, "replaced"))
            name = BirthId(self._number, immigrant_queue.settled)
            place = self._draw_place(name, Purpose.IMMIGRANT_PLACE)
            robot = develop(immigrant.genome, self._space)
            self._living.add(LivingRobot(immigrant, robot, place))
            self._pending.insert(immigrant.birth, robot, place)

    def _advance(self) -> AdvanceShard:
        clock, step = self._clock, self.step
        until = (
            clock.next_founder(step) if self._founders else clock.next_decision(step)
        )
        wants_snapshot = clock.is_snapshot_due(step, until)
        self._awaited = AdvanceShard(
            self._number, self._advances, until, self._pending.take(), wants_snapshot
        )
        return self._awaited

    def _obey(self, event: Commanded) -> list[ArenaCommand]:
        """Take an order; it is carried out at the next decision, or now if held."""
        if event.command_id in self._order_ids or self.is_finished:
            return []
        if (event.island, event.step) != (self._number, self.next_step):
            raise self._unexpected(event, f"orders take effect at {self.next_step}")
        check_order(event.order, self._experiment)
        self._order_ids.add(event.command_id)
        self._orders.append(event.order)
        return self._conclude() if self._is_held else []

    def _carry_out(self, order: Order) -> list[Record]:
        match order:
            case Pause() | Resume():
                self.is_paused = isinstance(order, Pause)
            case Insert():
                self._guests.append(order)
            case Remove(birth=birth) if self._living.get(birth):
                return [self._gone(self._living.remove(birth), "removed")]
            case ReplaceBrain(birth=birth, brain=brain):
                resident = self._living.get(birth)
                robot = resident and rewired(resident.robot, brain, self._space)
                if resident and robot:
                    resident.robot = robot
                    self._pending.rewire(birth, robot)
        return []

    def _born(self, candidate: Candidate) -> list[Record]:
        """Insert a candidate of this island's own."""
        parents = candidate.couple or ()
        rank = 1 + max((parent.rank for parent in parents), default=0)
        individual = Individual(candidate.birth, candidate.genome, 0.0, rank, None)
        attempts = candidate.attempt + 1
        return self._insert(individual, candidate.robot, parents, attempts, None)

    def _insert(
        self,
        individual: Individual,
        robot: Robot,
        parents: Couple | tuple[()],
        attempts: int,
        place: Place | None,
    ) -> list[Record]:
        """Let somebody live from this step on."""
        birth = individual.birth
        if place is None:
            place = self._draw_place(birth, Purpose.PLACE)
        self.births += 1
        self._living.add(LivingRobot(individual, robot, place))
        self._pending.insert(birth, robot, place)
        born = birth_record(
            individual, parents, attempts, robot, self._space,
            sim_time_s=self._clock.seconds(self.step), place=place,
        )  # fmt: skip
        return [born, *living_records(self._living, self._number, self.births)]

    def _gone(self, resident: LivingRobot, reason: str) -> Record:
        """Have the world let go of somebody who has left the living."""
        self._pending.remove(resident.birth)
        return death_record(
            resident,
            reason,
            island=self._number,
            births=self.births,
            sim_time_s=self._clock.seconds(self.step),
        )

    def _draw_place(self, name: BirthId, purpose: Purpose) -> Place:
        """Return a place of chance, away from the living."""
        rng = stream(self._seed, self._run, name, 0, purpose)
        others = [one.last_place for one in self._living]
        return draw_place(BufferedRng(rng), others, self._rules)

    def _has_room(self) -> bool:
        return len(self._living) < self._rules.population_limit

    def _unexpected(self, event: ArenaEvent, why: str) -> UnexpectedEvent:
        return UnexpectedEvent(
            f"arena {self._number} at step {self.step}, {self.births} of "
            f"{self._experiment.births} born, {len(self._living)} alive, "
            f"{self._advances} advances done: {why}, got {event}"
        )
