"""What became of an arena, from the journal of its run, so as to do it again."""

import shutil
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from coordinator.dispatch.events import DispatchEvent
from coordinator.dispatch.fleet import Fleet
from coordinator.islands.events import Append, JournalledEvent, Record
from coordinator.run.archipelago import archipelago
from coordinator.run.loop import Loop
from coordinator.run.run_context import RunContext
from coordinator.storage.folder import read_details
from coordinator.storage.journal import NAME, Journal
from coordinator.storage.snapshots import Snapshots
from schema.errors import RunFolderError
from schema.experiment.document import steps_of
from schema.experiment.file import experiment_from_text
from schema.wire.arena_codec import Rebuild


def arena_history(folder: Path, island: int, from_s: float) -> tuple[bytes, Rebuild]:
    """Return what a worker needs to do again what happened in an arena.

    Args:
        folder: of a run, finished or not; nothing in it is changed.
        island: whose arena.
        from_s: what is to be seen; a kept snapshot from before it spares what came
            before that [s].

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
    loop = Loop(
        archipelago(experiment, details.seed, details.run),
        context=context,
        fleet=Fleet(_Nobody()),
        log=_Nothing(),
        rows=_Nothing(),
        snapshot_store=snapshot_store,
    )
    with tempfile.TemporaryDirectory() as place:
        # A copy: opening a journal mends it, and its run may be alive.
        shutil.copy(folder / NAME, place)
        with Journal.open(Path(place)) as journal:
            loop.start(journal.replay())
    return context.arena[island], loop.shard_requests.past(island)


@dataclass(frozen=True, slots=True)
class _SnapshotStore:
    """The snapshots of a run up to a step; none is made or removed."""

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


class _Nobody:
    """No agent is there: what is asked stays open."""

    def send(self, number: int, agent: str, payload: bytes) -> None:
        """Send nothing."""

    def cancel(self, _agent: str, _payload: bytes, /) -> None:
        """Cancel nothing."""

    def receive(
        self, _timeout_s: float, _pause_s: float = 0.0, /
    ) -> Sequence[DispatchEvent]:
        return ()


class _Nothing:
    """Rows and events that stand on disk already."""

    def write(self, record: Record) -> None:
        """Write nothing."""

    def store(self, rows: Append) -> None:
        """Store nothing."""

    def append(self, rows: Append | Sequence[JournalledEvent]) -> None:
        """Append nothing."""
