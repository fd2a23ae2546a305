"""History of an arena from the journal of its run, for a re-simulation."""

from pathlib import Path

from coordinator.dispatch.fleet import JobRouter
from coordinator.network.local import LocalAgents
from coordinator.run.archipelago import archipelago
from coordinator.run.loop import Loop
from coordinator.run.run_context import RunContext
from coordinator.storage.folder import read_details
from coordinator.storage.journal import NAME, read_events
from coordinator.storage.snapshots import Snapshots
from schema.errors import RunFolderError
from schema.experiment.document import island_experiments, steps_of
from schema.experiment.file import experiment_from_text
from schema.tables.description import RunDetails
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
    islands = island_experiments(experiment_from_text(details.document))
    if island not in range(len(islands)) or islands[island].arena is None:
        raise RunFolderError(f"{folder}: island {island} has no arena")
    until = steps_of(from_s, islands[island].simulation)
    loop = begun_loop(details, Snapshots(folder, until=until))
    for event in read_events(folder / NAME)[0]:
        loop.repeat(event)
    return loop.context.arena[island], loop.shard_requests.past(island)


def begun_loop(details: RunDetails, store: Snapshots = NO_SNAPSHOTS) -> Loop:
    """Return the islands of a run at its start; they act on nothing outside.

    ``store``: snapshots on disk, read-only.
    """
    experiment = experiment_from_text(details.document)
    loop = Loop(
        archipelago(
            experiment, details.seed, details.run, details.founders, details.group
        ),
        context=RunContext.of(details.name, 0, experiment, details.origin),
        fleet=JobRouter(LocalAgents({}, "")),
        log=None,
        rows=None,
        snapshot_store=store,
    )
    loop.begin()
    return loop
