"""Drives a run: answers in, journal first, then the machines' decisions.

The machines decide and this loop carries out. Nothing that an answer changes is
acted on before the journal has it, so a coordinator that is killed at any point
comes back to the same decisions by replaying its journal.
"""

import logging
from collections import deque
from collections.abc import Callable, Iterable, Mapping, Sequence
from math import inf
from typing import Protocol

from coordinator.arena.arena import Arena
from coordinator.dispatch.fleet import Fleet, JobClient, ShardClient
from coordinator.islands.events import (
    Advanced,
    AdvanceShard,
    Append,
    ArenaCommand,
    Audited,
    Commanded,
    Emigrate,
    Evaluate,
    Evaluated,
    EvaluationFailed,
    ExternalEvent,
    Finish,
    Immigrated,
    IslandCommand,
    JournalledEvent,
    MigrationEvent,
    NeighbourClosed,
    Record,
    Started,
    Vet,
    Vetted,
    VettingFailed,
    requester_of,
)
from coordinator.islands.island import Island
from coordinator.run.advances import Advances, SnapshotStore, Terms
from coordinator.run.cross_checks import NO_CHECKS, Checks, audit_records, describe
from coordinator.run.requests import Requests, RunContext, is_quarantined
from coordinator.run.throttle import RealTimeThrottle
from schema.errors import RunPaused, UnexpectedEvent
from schema.robot.ids import BirthId

_LOG = logging.getLogger(__name__)

Key = tuple[str, int, BirthId, int]
"""What an open question is known by: kind, requester, birth, attempt or trial."""

Asked = Vet | Evaluate | AdvanceShard
"""What islands and arenas have others do."""

Told = Started | ExternalEvent | MigrationEvent
"""What islands and arenas are told."""


class Log(Protocol):
    """What survives a crash of this process."""

    def append(self, events: Sequence[JournalledEvent]) -> None:
        """Keep events, durably, before anybody acts on them."""


class Rows(Protocol):
    """Where table rows go."""

    def write(self, record: Record) -> None:
        """Take one row."""

    def store(self, rows: Append) -> None:
        """Bring bulk rows to disk before the journal has what they belong to."""

    def append(self, rows: Append) -> None:
        """Take bulk rows that the journal has."""


class Loop:
    """One run's machines and what connects them to the world.

    Attributes:
        islands: the machines, by their numbers.
        advances: those of the arenas.
    """

    def __init__(
        self,
        islands: Mapping[int, Island | Arena],
        *,
        context: RunContext,
        fleet: Fleet,
        log: Log,
        rows: Rows,
        snapshot_store: SnapshotStore,
        throttle: RealTimeThrottle | None = None,
        checks: Checks = NO_CHECKS,
        confirm: Callable[[], None] = lambda: None,
    ) -> None:
        """Connect machines; nothing happens before ``start``.

        ``confirm`` raises if this process may not write to the run any more.
        """
        self.islands = dict(islands)
        self.advances = Advances(
            Terms(context.run, context.epoch, context.arena),
            snapshot_store,
            fleet,
        )
        self._requests = Requests(context, fleet, checks.audit)
        self._checks = checks
        self._confirm = confirm
        self._fleet = fleet
        self._log = log
        self._rows = rows
        self._throttle = throttle
        self._held_back: dict[int, float] = {}
        self._now_s = 0.0

    @property
    def is_finished(self) -> bool:
        """Every island is done."""
        return all(island.is_finished for island in self.islands.values())

    @property
    def is_throttled(self) -> bool:
        """Arenas may be held back."""
        return self._throttle is not None

    @property
    def clients(self) -> tuple[JobClient, ShardClient]:
        """Whom the fleet names if there is news for this run."""
        return self._requests, self.advances

    @property
    def wake_s(self) -> float:
        """When ``act`` is due though nothing came, for the sake of the pace [s]."""
        return min(self._held_back.values(), default=inf)

    @property
    def malformed(self) -> int:
        """Answers that did not decode or did not fit their question."""
        return self._requests.malformed + self.advances.malformed

    def start(self, history: Iterable[JournalledEvent]) -> None:
        """Begin, or come back: replay a journal, then ask what is still open.

        Args:
            history: the journalled events, oldest first; empty for a new run.

        Raises:
            UnexpectedEvent: the history of another kind of run.
        """
        unanswered: dict[Key, Vet | Evaluate] = {}

        def note(commands: Iterable[Asked]) -> None:
            for command in commands:
                if isinstance(command, AdvanceShard):
                    self.advances.note(command)
                else:
                    unanswered[_key(command)] = command

        for number in sorted(self.islands):
            note(self._tell(number, Started()))
        for event in history:
            if isinstance(event, Audited):
                self._note_audit(event)
                continue
            if not isinstance(event, Advanced | Commanded):
                unanswered.pop(_key(event), None)
            note(self._tell(_island(event), event))
        for command in unanswered.values():
            self._requests.ask(command)
        for number in sorted(self.islands):
            self.advances.request(number)

    def act(self, now_s: float) -> None:
        """Take what came and act on it.

        Args:
            now_s: the time, of any clock that only goes forward [s].

        Raises:
            JobRefused: nobody can do a job; the run stops as it is.
            ExperimentError: restrictions that no robot meets.
            RunFolderError: the disk is full or failed, or another coordinator has
                taken the run over.
            RunPaused: something is to be seen by the user first.
        """
        self._now_s = now_s
        for shard, due_s in sorted(self._held_back.items()):
            if due_s <= now_s:
                del self._held_back[shard]
                self.advances.request(shard)
        self._take([*self._requests.take(), *self.advances.come()])

    def leave(self) -> None:
        """Ask no more, and wait for nothing."""
        self._fleet.leave(self._requests)
        self.advances.release()

    def order(self, event: Commanded) -> None:
        """Take what an operator ordered; the journal has it on return.

        Raises:
            UnexpectedEvent: it is not for an arena of this run.
        """
        if not isinstance(self.islands.get(event.island), Arena):
            raise UnexpectedEvent(f"no arena {event.island}: {event}")
        self._take([event])

    def _take(self, events: Sequence[JournalledEvent]) -> None:
        """Keep events, then act on them."""
        if not events:
            return
        # One that slept through its replacement must not write a byte.
        self._confirm()
        for event in events:
            if isinstance(event, Advanced) and event.pose_rows:
                poses = event.advance.poses
                self._rows.store(Append("poses", event.pose_rows, poses))
        self._log.append(events)
        for event in events:
            if isinstance(event, Audited):
                self._note_audit(event)
                continue
            for command in self._tell(_island(event), event):
                if isinstance(command, AdvanceShard):
                    self._advance(command)
                else:
                    self._requests.ask(command)

        self._take_care(events)

    def _note_audit(self, event: Audited) -> None:
        for record in audit_records(event):
            self._rows.write(record)

    def _take_care(self, events: Sequence[JournalledEvent]) -> None:
        """Tell the user what is not as it should be.

        Raises:
            RunPaused: two workers do not agree, or a robot is quarantined and the
                user wanted to know of that first.
        """
        for event in events:
            if isinstance(event, Audited) and not event.agrees:
                raise RunPaused(describe(event))
            if isinstance(event, EvaluationFailed) and is_quarantined(event):
                birth = event.birth
                line = f"birth {birth.number} of island {birth.island}: {event.reason}"
                if self._checks.pauses:
                    raise RunPaused(f"{line}; resume to go on without it")
                _LOG.warning("%s", line)

    def _advance(self, command: AdvanceShard) -> None:
        """Ask for an advance, now or when it is due."""
        shard = command.island
        self.advances.note(command)
        if self._throttle is not None:
            step = self.advances.step(shard)
            due_s = self._throttle.due_s(shard, step, self._now_s)
            if due_s > self._now_s:
                self._held_back[shard] = due_s
                return
        self.advances.request(shard)

    def _tell(self, number: int, event: Started | ExternalEvent) -> list[Asked]:
        """Give an island its event, and others what comes of it; return the questions.

        Raises:
            UnexpectedEvent: nobody here takes such an event.
        """
        asked: list[Asked] = []
        told: deque[tuple[int, Told]] = deque([(number, event)])
        while told:
            for command in self._handled(*told.popleft()):
                match command:
                    case Record():
                        self._rows.write(command)
                    case Append():
                        self._rows.append(command)
                    case Vet() | Evaluate() | AdvanceShard():
                        asked.append(command)
                    case Emigrate(island, to, epoch, migrants):
                        told.append((to, Immigrated(to, island, epoch, migrants)))
                    case Finish(island, neighbours):
                        told += [(to, NeighbourClosed(to, island)) for to in neighbours]
        return asked

    def _handled(
        self, number: int, event: Told
    ) -> Iterable[IslandCommand | ArenaCommand]:
        """Return what an island answers to an event.

        Raises:
            UnexpectedEvent: nobody here takes such an event.
        """
        machine = self.islands.get(number)
        if isinstance(machine, Arena):
            if isinstance(event, Advanced) and (drift := self.advances.take(event)):
                _LOG.warning("%s", drift)
                self._rows.write(drift.record)
            if not isinstance(event, Evaluated | EvaluationFailed):
                return machine.handle(event)
        elif machine is not None and not isinstance(event, Advanced | Commanded):
            return machine.handle(event)
        raise UnexpectedEvent(f"no island here takes {event}")


def _island(event: ExternalEvent) -> int:
    """Return whose event it is."""
    if isinstance(event, Advanced | Commanded):
        return event.island
    return requester_of(event)


def _key(
    about: Vet | Evaluate | Vetted | VettingFailed | Evaluated | EvaluationFailed,
) -> Key:
    """Return what a question and its answer have in common."""
    if isinstance(about, Vet | Vetted | VettingFailed):
        return ("vet", about.birth.island, about.birth, about.attempt)
    return ("evaluate", requester_of(about), about.birth, about.trial)
