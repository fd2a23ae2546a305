"""History of an arena from the journal of its run, for a re-simulation."""

from collections.abc import Iterable, Sequence
from pathlib import Path

from coordinator.dispatch.fleet import JobRouter
from coordinator.islands.events import Advanced, JournalledEvent, Record
from coordinator.network.local import LocalAgents
from coordinator.run.archipelago import archipelago
from coordinator.run.loop import Loop
from coordinator.run.run_context import RunContext
from coordinator.run.shard_requests import SnapshotStore
from coordinator.storage.folder import RunDetails, read_details
from coordinator.storage.journal import NAME, read_events
from coordinator.storage.snapshots import Snapshots
from schema.errors import RunFolderError
from schema.experiment.document import steps_of
from schema.experiment.file import experiment_from_text
from schema.wire.arena import Rebuild

NO_SNAPSHOTS = Snapshots(Path(), until=-1)
"""Store of islands that repeat all of a run, from its first advance."""


def arena_history(folder: Path, island: int, from_s: float) -> tuple[bytes, Rebuild]:
    """Return what a worker needs to re-simulate an arena.

    ``folder``: of a run, finished or not; nothing in it is changed. ``from_s``: time of
    interest; the re-simulation starts at the newest snapshot before it [s].

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
    until = steps_of(from_s, context.experiments[island].simulation)
    store = Snapshots(folder, until=until)
    events, _ = read_events(folder / NAME)
    loop = replayed(details, context, events, store=store)
    return context.arena[island], loop.shard_requests.past(island)


def replayed(
    details: RunDetails,
    context: RunContext,
    events: Iterable[JournalledEvent],
    *,
    store: SnapshotStore,
) -> Loop:
    """Return the islands of a run after a journal, without any effect.

    ``store``: snapshots on disk, read-only.

    Raises:
        UnexpectedEvent: the journal of another kind of run.
    """
    loop = begun_loop(details, context, store)
    for event in events:
        loop.repeat(event)
    return loop


def begun_loop(
    details: RunDetails, context: RunContext, store: SnapshotStore = NO_SNAPSHOTS
) -> Loop:
    """Return the islands of a run at its start; they act on nothing outside."""
    experiment = experiment_from_text(details.document)
    loop = Loop(
        archipelago(experiment, details.seed, details.run, details.founders),
        context=context,
        fleet=JobRouter(LocalAgents({}, "")),
        log=_Nothing(),
        rows=_Nothing(),
        snapshot_store=store,
    )
    loop.begin()
    return loop


class _Nothing:
    """Journal and tables that take nothing: all is on disk already."""

    def write(self, record: Record) -> None:
        """Write nothing."""

    def store(self, event: Advanced) -> None:
        """Store nothing."""

    def append(self, events: Advanced | Sequence[JournalledEvent]) -> None:
        """Append nothing."""
