"""Main loop of a run: journals each answer, then passes it to the state machines.

The state machines decide, and this loop carries out their commands. It stores each
answer in the journal before it acts on it, so a coordinator that is killed at any
point makes the same decisions again when it replays its journal.
"""

from collections import deque
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import KW_ONLY, dataclass
from itertools import chain

from coordinator.arena.arena import Arena
from coordinator.dispatch.events import Deliver
from coordinator.dispatch.fleet import JobRouter
from coordinator.islands.events import (
    Advanced,
    Answered,
    Append,
    ArenaCommand,
    Ask,
    Asked,
    Audited,
    Commanded,
    Emigrate,
    EvaluationFailed,
    ExternalEvent,
    Finish,
    Immigrated,
    IslandCommand,
    JournalledEvent,
    MigrationEvent,
    NeighbourClosed,
    Outcome,
    Record,
    Served,
    Started,
    arrival,
    brief,
)
from coordinator.islands.island import Island
from coordinator.islands.outbox import Outbox
from coordinator.run.cross_checks import NO_CHECKS, Checks, audit_records, describe
from coordinator.run.learners import Learners
from coordinator.run.requests import Key, Requests, island_of, key_of
from coordinator.run.run_context import RunContext
from coordinator.run.shard_requests import ShardRequests
from coordinator.run.throttle import RealTimeThrottle
from coordinator.storage.journal import Journal
from coordinator.storage.recorder import Recorder
from coordinator.storage.snapshots import Snapshots
from schema.agent.log import warn_user
from schema.errors import RunPaused, UnexpectedEvent
from schema.wire.arena import AdvanceShard
from schema.wire.messages import Breed, Evaluate

Request = Breed | Evaluate | AdvanceShard | Ask
"""Commands of islands and arenas that agents or learners carry out."""

Question = Request | tuple[AdvanceShard | None, int]
"""What an event answers: a request, for an order an advance and a step, or for migrants
of another group their epoch."""

Event = Started | ExternalEvent | MigrationEvent
"""Events of islands and arenas."""


_RECENT = 20
"""Events that the error about an unexpected one names."""


@dataclass(eq=False)
class Loop:
    """The islands of a run and their connection to agents, journal and tables.

    Attributes:
        islands: the state machines of the islands here, by number.
        outbox: migrants for islands of other groups.
        log: the journal; None if events of it are only repeated.
        rows: the tables; None if nothing is to be written.
        snapshot_store: the snapshots of arenas.
        throttle: limits the speed of arenas; None: no limit.
        parts: of an arena, for as many workers; None: as many as pay.
        checks: cross-checks to make.
        confirm: raises if this process may no longer write to the run.
        watch: called with each row, for viewers; None without any.
        shard_requests: the advances of the arenas.
    """

    islands: Mapping[int, Island | Arena]
    _: KW_ONLY
    context: RunContext
    fleet: JobRouter
    log: Journal | None
    rows: Recorder | None
    snapshot_store: Snapshots
    throttle: RealTimeThrottle | None = None
    parts: int | None = None
    checks: Checks = NO_CHECKS
    confirm: Callable[[], None] = lambda: None
    watch: Callable[[Record], None] | None = None

    def __post_init__(self) -> None:
        """Connect the state machines; ``start`` starts them."""
        context, fleet = self.context, self.fleet
        self.client = context.client
        self.shard_requests = ShardRequests(
            context, self.snapshot_store, fleet, self.parts
        )
        self._requests = Requests(context, fleet, self.checks)
        self._learners = Learners(context.experiments, context.origin)
        self.outbox = Outbox()
        self._now_s = 0.0
        self._recent: deque[Event | str] = deque(maxlen=_RECENT)
        self._unanswered: dict[Key, Breed | Evaluate | Ask] = {}

    @property
    def is_finished(self) -> bool:
        """Every island is done."""
        return all(island.is_finished for island in self.islands.values())

    def start(self, history: Iterable[JournalledEvent]) -> None:
        """Start or resume: replay a journal, then send the requests that are open.

        Raises:
            UnexpectedEvent: the history of another kind of run.
            ExperimentError: a learner fails.
        """
        self.begin()
        for event in history:
            self.repeat(event)
        asks: list[Ask] = []
        for request in self._unanswered.values():
            if isinstance(request, Ask):
                asks.append(request)
            else:
                self._requests.send(request)
        self._unanswered.clear()
        self.shard_requests.send_noted()
        self.take([self._learners.answer(each) for each in asks])

    def begin(self) -> None:
        """Start the islands; their requests are only noted."""
        for number in sorted(self.islands):
            self._note(self._tell(number, Started()))

    def repeat(self, event: JournalledEvent) -> None:
        """Act on an event of the journal; requests are only noted.

        Raises:
            UnexpectedEvent: it is of another kind of run.
        """
        if isinstance(event, Answered):
            self._unanswered.pop(key_of(event), None)
        self._note(self._act_on(event))

    def question(self, event: JournalledEvent) -> Question | None:
        """Return what an event of the journal answers here; None for nothing.

        An order answers nothing, but its arena must stand at the same decision. That a
        neighbour closed depends on the number of its births.
        """
        if isinstance(event, Audited | Answered):
            answer = event.first if isinstance(event, Audited) else event
            return self._unanswered.get(key_of(answer))
        if isinstance(event, Immigrated):
            return self._awaited(event)
        if isinstance(event, NeighbourClosed | Served):
            return None
        requested = self.shard_requests.requested(event.island)
        if isinstance(event, Advanced):
            is_it = requested is not None and requested.number == event.number
            return requested if is_it else None
        arena = self.islands.get(event.island)
        is_due = isinstance(arena, Arena) and arena.next_step == event.step
        return (requested, event.step) if is_due else None

    def _awaited(self, event: Immigrated) -> Question | None:
        """Return what migrants answer if an island here awaits them.

        None if they would be others in a longer run.
        """
        epochs = self.islands[event.island].epochs
        awaited = epochs.next_epochs.get(event.source) if epochs else None
        is_it = awaited == event.epoch and not event.follows_closing
        return (None, event.epoch) if is_it else None

    def _note(self, requests: Iterable[Request]) -> None:
        for request in requests:
            if isinstance(request, AdvanceShard):
                self.shard_requests.note(request)
            else:
                self._unanswered[key_of(request)] = request

    def act(self, now_s: float, ends: Iterable[Deliver] = ()) -> None:
        """Act on the ends of jobs and advances.

        Raises:
            JobRefused: no agent can do a job; the run stops as it is.
            ExperimentError: restrictions that no robot meets, or a learner that fails.
            RunFolderError: the disk is full or failed, or another coordinator has
                taken the run over.
            RunPaused: the user has to decide first.
        """
        self._now_s = now_s
        if self.throttle is not None:
            for command in self.throttle.due(now_s):
                self.shard_requests.send(command)
        events: list[JournalledEvent] = []
        for end in ends:
            if end.job.shard < 0:
                events += self._requests.events(end)
            elif reached := self.shard_requests.take(end):
                event, snapshot = reached.event, reached.snapshot
                if snapshot:
                    # It must be on disk before the journal has the advance.
                    step = event.advance.step
                    self.snapshot_store.write(event.island, step, snapshot)
                events.append(event)
        self.take(events)

    def leave(self) -> None:
        """Drop all open requests."""
        self.fleet.leave(self.client)

    def order(self, event: Commanded) -> None:
        """Take an operator's order; the journal has it on return.

        Raises:
            UnexpectedEvent: it is not for an arena of this run.
        """
        if not isinstance(self.islands.get(event.island), Arena):
            raise UnexpectedEvent(f"no arena {event.island}: {event}")
        self.take([event])

    def take(self, events: Sequence[JournalledEvent]) -> None:
        """Store events, then act on them, and on the answers of learners.

        Raises:
            RevolveError: as of ``act``.
        """
        while events:
            # A process that was suspended while another took over must not write.
            self.confirm()
            assert self.log is not None
            assert self.rows is not None
            for event in events:
                if isinstance(event, Advanced) and event.pose_rows:
                    self.rows.poses.store(event)
            self.log.append(events)
            answers: list[Asked] = []
            for request in chain.from_iterable(map(self._act_on, events)):
                if isinstance(request, AdvanceShard):
                    self._advance(request)
                elif isinstance(request, Ask):
                    answers.append(self._learners.answer(request))
                else:
                    self._requests.send(request)
            self._warn(events)
            events = answers

    def _act_on(self, event: JournalledEvent) -> list[Request]:
        if isinstance(event, Served):
            self.outbox.served.add(event.group)
            return []
        if isinstance(event, NeighbourClosed):
            self.shard_requests.keep_snapshots()
        if not isinstance(event, Audited):
            return self._tell(island_of(event), event)
        for record in audit_records(event):
            self._write(record)
        return []

    def _warn(self, events: Sequence[JournalledEvent]) -> None:
        """Warn the user about cross-checks that failed and robots that crash workers.

        Raises:
            RunPaused: two workers do not agree, or a robot is quarantined and the
                user wanted the run to stop then.
        """
        for event in events:
            if isinstance(event, Audited) and not event.is_settled:
                raise RunPaused(describe(event))
            if isinstance(event, EvaluationFailed) and event.is_quarantined:
                birth = event.birth
                line = f"birth {birth.number} of island {birth.island}: {event.reason}"
                if self.checks.pauses:
                    raise RunPaused(f"{line}; resume to go on without it")
                warn_user(line)

    def _advance(self, command: AdvanceShard) -> None:
        """Request an advance, now or when it is due."""
        if self.throttle is not None:
            island = self.islands[command.island]
            assert isinstance(island, Arena)
            begin_s = island.clock.seconds(self.shard_requests.step(command.island))
            if self.throttle.holds_back(command, begin_s, self._now_s):
                return
        self.shard_requests.send(command)

    def _tell(self, number: int, first: Event) -> list[Request]:
        """Deliver an event, carry out the commands, return the requests to send.

        Raises:
            UnexpectedEvent: no island takes such an event.
        """
        requests: list[Request] = []
        events: deque[tuple[int, Event]] = deque([(number, first)])
        while events:
            to, event = events.popleft()
            # The poses of an advance are large.
            self._recent.append(brief(event) if isinstance(event, Advanced) else event)
            try:
                commands = self._handled(to, event)
            except UnexpectedEvent as error:
                last = "; ".join(map(brief, self._recent))
                raise UnexpectedEvent(f"{error}; the last events: {last}") from error
            for command in commands:
                match command:
                    case Record():
                        self._write(command)
                    case Append(advanced) if self.rows is not None:
                        self.rows.poses.take_advance(advanced)
                    case Breed() | Evaluate() | AdvanceShard() | Ask():
                        requests.append(command)
                    case Emigrate():
                        events += self._sent(arrival(command))
                    case Finish(island, neighbours):
                        self.shard_requests.keep_snapshots()
                        for to in neighbours:
                            events += self._sent(NeighbourClosed(to, island))
        return requests

    def _sent(self, event: MigrationEvent) -> list[tuple[int, Event]]:
        """Return an event with the island here that it is for; keep it for others."""
        if event.island in self.islands:
            return [(event.island, event)]
        self.outbox.put(event)
        return []

    def _write(self, record: Record) -> None:
        if self.rows is not None:
            self.rows.write(record)
        if self.watch is not None:
            self.watch(record)

    def _handled(
        self, number: int, event: Event
    ) -> Iterable[IslandCommand | ArenaCommand]:
        machine = self.islands.get(number)
        if isinstance(machine, Arena):
            if isinstance(event, Advanced) and (
                drift := self.shard_requests.commit(event)
            ):
                warn_user(str(drift))
                self._write(drift.record)
            if not isinstance(event, Outcome):
                return machine.handle(event)
        elif machine is not None and not isinstance(event, Advanced | Commanded):
            return machine.handle(event)
        raise UnexpectedEvent(f"no island here takes {brief(event)}")
