"""Recovery of lost poses: the arenas of a run are simulated again, from its journal.

The journal holds all results of an advance but its poses. If poses are missing on disk,
workers of the same platform repeat the advances in the order of the journal. Each must
reach the state whose digest the journal holds.
"""

from collections import defaultdict, deque
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field

from coordinator.dispatch.events import Deliver
from coordinator.dispatch.fleet import JobRouter
from coordinator.islands.events import Advanced, JournalledEvent
from coordinator.run.history import begun_loop
from coordinator.run.run_context import RunContext
from coordinator.run.shard_answers import Reached
from coordinator.run.shard_requests import ShardRequests
from coordinator.storage.recorder import Recorder
from coordinator.storage.snapshots import Snapshots
from schema.tables.description import RunDetails
from schema.wire.arena import AdvanceShard

MOST_AHEAD = 64
"""Advances of an arena whose poses are kept until those before are written."""


@dataclass(slots=True, eq=False)
class _Arena:
    """Advances of an arena that are repeated.

    Attributes:
        left: commands, each with the result in the journal; the first is requested.
        first: number of the first advance whose poses are lost.
        reached: results whose poses were lost, not written yet.
    """

    left: deque[tuple[AdvanceShard, Advanced]]
    first: int
    reached: deque[Advanced] = field(default_factory=deque)

    @property
    def is_full(self) -> bool:
        """The next advance is requested when results before it are written."""
        return len(self.reached) >= MOST_AHEAD


class PoseRecovery:
    """Computes the lost poses of a run again, before the run continues."""

    def __init__(
        self,
        details: RunDetails,
        context: RunContext,
        events: Sequence[JournalledEvent],
        *,
        fleet: JobRouter,
        recorder: Recorder,
        snapshots: Snapshots,
    ) -> None:
        """Find out what is lost; ``start`` requests the first advances.

        Raises:
            UnexpectedEvent: the journal of another kind of run.
            RunFolderError: the disk failed.
        """
        self._client = context.client
        self._fleet = fleet
        self._recorder = recorder
        self._order = deque(_lost(events, recorder.poses.stored))
        self._snapshots = snapshots
        self._requests = ShardRequests(context, snapshots, fleet)
        self._arenas: dict[int, _Arena] = {}
        if self._order:
            recorder.poses.keep(pose_rows(events) - pose_rows(self._order))
            self._plan(_advances(details, events))
        self._total = sum(len(arena.left) for arena in self._arenas.values())

    def _plan(
        self, advances: Mapping[int, list[tuple[AdvanceShard, Advanced]]]
    ) -> None:
        """Let each arena begin at its newest snapshot before its first lost poses."""
        first: dict[int, int] = {}
        last: dict[int, int] = {}
        for event in self._order:
            first.setdefault(event.island, event.number)
            last[event.island] = event.number
        for island in sorted(first):
            own = advances[island][: last[island] + 1]
            begin = 0
            for number in range(first[island], 0, -1):
                event = own[number - 1][1]
                if self._snapshots.has(
                    island, event.advance.step, event.advance.digest
                ):
                    self._requests.begin_at(own[number - 1][1])
                    begin = number
                    break
            self._arenas[island] = _Arena(deque(own[begin:]), first[island])

    @property
    def is_done(self) -> bool:
        """All poses are on disk."""
        return not self._order

    @property
    def progress(self) -> tuple[int, int]:
        """Number of advances that are done, and of all."""
        left = sum(len(arena.left) for arena in self._arenas.values())
        return self._total - left, self._total

    @property
    def waiting(self) -> dict[int, str]:
        """Platforms of the arenas that wait for a worker."""
        return self._requests.waiting

    def start(self) -> None:
        """Request the first advance of each arena."""
        for arena in self._arenas.values():
            self._requests.send(*arena.left[0])

    def act(self, ends: Iterable[Deliver]) -> None:
        """Take the results of advances and write their poses in the journal's order.

        Raises:
            JobRefused: several workers cannot repeat an advance.
            RunFolderError: the disk is full or failed.
        """
        for end in ends:
            if reached := self._requests.take(end):
                self._take(reached)
        if self.is_done:
            self._fleet.leave(self._client)

    def _take(self, reached: Reached) -> None:
        event = reached.event
        arena = self._arenas[event.island]
        _, past = arena.left.popleft()
        if reached.snapshot:
            step = past.advance.step
            # A recovery that is interrupted continues from it.
            self._snapshots.write(event.island, step, reached.snapshot)
        self._requests.commit(event)
        if past.number >= arena.first and past.pose_rows:
            arena.reached.append(event)
        idle = [each for each in self._arenas.values() if each.is_full]
        self._write()
        if arena not in idle:
            idle.append(arena)
        for each in idle:
            if each.left and not each.is_full:
                self._requests.send(*each.left[0])

    def _write(self) -> None:
        """Write the poses of all results up to the first that is missing."""
        while self._order:
            reached = self._arenas[self._order[0].island].reached
            if not reached:
                return
            self._recorder.poses.restore(reached.popleft())
            self._order.popleft()


def pose_rows(events: Iterable[JournalledEvent]) -> int:
    """Return the number of rows of poses that a journal counts."""
    return sum(each.pose_rows for each in events if isinstance(each, Advanced))


def _lost(events: Iterable[JournalledEvent], stored: int) -> Iterator[Advanced]:
    """Yield the advances whose poses are not all on disk, in the journal's order."""
    rows = 0
    for event in events:
        if isinstance(event, Advanced) and event.pose_rows:
            rows += event.pose_rows
            if rows > stored:
                yield event


def _advances(
    details: RunDetails, events: Iterable[JournalledEvent]
) -> dict[int, list[tuple[AdvanceShard, Advanced]]]:
    advances: dict[int, list[tuple[AdvanceShard, Advanced]]] = defaultdict(list)
    loop = begun_loop(details)
    for event in events:
        if isinstance(event, Advanced):
            command = loop.shard_requests.requested(event.island)
            if command is not None:  # otherwise ``repeat`` raises
                advances[event.island].append((command, event))
        loop.repeat(event)
    return advances
