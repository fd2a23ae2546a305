"""History of an arena from the journal of its run, for a re-simulation."""

import shutil
import tempfile
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from coordinator.dispatch.fleet import Fleet
from coordinator.islands.events import (
    Advanced,
    AdvanceShard,
    Append,
    JournalledEvent,
    Record,
)
from coordinator.network.local import LocalAgents
from coordinator.run.archipelago import archipelago
from coordinator.run.loop import Loop
from coordinator.run.run_context import RunContext
from coordinator.run.shard_requests import SnapshotStore
from coordinator.storage.folder import RunDetails, read_details
from coordinator.storage.journal import NAME, Journal
from coordinator.storage.snapshots import Snapshots
from schema.errors import RunFolderError
from schema.experiment.document import steps_of
from schema.experiment.file import experiment_from_text
from schema.wire.arena_codec import Rebuild


def arena_history(folder: Path, island: int, from_s: float) -> tuple[bytes, Rebuild]:
    """Return what a worker needs to re-simulate an arena.

    Args:
        folder: of a run, finished or not; nothing in it is changed.
        island: of the arena.
        from_s: time of interest; the re-simulation starts at the newest snapshot
            before it [s].

    Returns:
        JSON of the arena's settings; a state, and all advances since then.

    Raises:
        RunFolderError: no run, or a damaged journal.
    """
    details = read_details(folder)
    experiment = experiment_from_text(details.document)
    context = RunContext.of(str(folder), 0, experiment, details.origin)
    if island not in context.arena:
        raise RunFolderError(f"{folder}: island {island} has no arena")
    snapshot_store = _SnapshotStore(
        Snapshots(folder), steps_of(from_s, experiment.simulation)
    )
    with tempfile.TemporaryDirectory() as place:
        # A copy: opening a journal repairs it, and its run may be active.
        shutil.copy(folder / NAME, place)
        with Journal.open(Path(place)) as journal:
            loop = replayed(details, context, journal.replay(), store=snapshot_store)
    return context.arena[island], loop.shard_requests.past(island)


def replayed(
    details: RunDetails,
    context: RunContext,
    events: Iterable[JournalledEvent],
    *,
    store: SnapshotStore | None = None,
    note: Callable[[Advanced, AdvanceShard | None], None] = lambda *_: None,
) -> Loop:
    """Return the islands of a run after a journal, without any effect.

    Args:
        details: description of the run.
        context: what all requests have in common.
        events: content of the journal.
        store: snapshots on disk, None: without any.
        note: called with each advance and the command that it answers.

    Raises:
        UnexpectedEvent: the journal of another kind of run.
    """
    loop = Loop(
        archipelago(experiment_from_text(details.document), details.seed, details.run),
        context=context,
        fleet=Fleet(LocalAgents({}, "")),
        log=_Nothing(),
        rows=_Nothing(),
        snapshot_store=store or _NoSnapshots(),
    )

    def noted() -> Iterator[JournalledEvent]:
        for event in events:
            if isinstance(event, Advanced):
                note(event, loop.shard_requests.requested(event.island))
            yield event

    loop.start(noted())
    return loop


class _NoSnapshots:
    """Store without snapshots: histories begin at the start of an arena."""

    def has(self, _shard: int, _step: int, _digest: bytes) -> bool:
        return False

    def write(self, shard: int, step: int, data: bytes) -> None:
        """Keep nothing."""

    def read(self, _shard: int, _step: int) -> bytes:
        return b""

    def drop_before(self, shard: int, step: int) -> None:
        """Remove nothing."""


@dataclass(frozen=True, slots=True)
class _SnapshotStore:
    """Snapshots of a run up to a step, read-only."""

    kept: Snapshots
    until: int

    def has(self, shard: int, step: int, digest: bytes) -> bool:
        return step <= self.until and self.kept.has(shard, step, digest)

    def write(self, shard: int, step: int, data: bytes) -> None:
        """Keep nothing."""

    def read(self, shard: int, step: int) -> bytes:
        return self.kept.read(shard, step)

    def drop_before(self, shard: int, step: int) -> None:
        """Remove nothing."""


class _Nothing:
    """Journal and tables that take nothing: all is on disk already."""

    def write(self, record: Record) -> None:
        """Write nothing."""

    def store(self, rows: Append) -> None:
        """Store nothing."""

    def append(self, rows: Append | Sequence[JournalledEvent]) -> None:
        """Append nothing."""
