"""A run with another number of births: what of its journal stays.

An answer stays if the islands ask the same question under the new number. Others are
void, such as what followed in an archipelago when an island had closed, or the last
re-evaluations of a population; the run goes on without them and asks anew. So it
becomes equal to a run that was begun with the new number.
"""

import os
from collections.abc import Iterable, Iterator
from dataclasses import replace
from pathlib import Path

import pyarrow as pa
from msgspec import structs

from coordinator.islands.events import Advanced, JournalledEvent
from coordinator.run.history import silent_loop
from coordinator.run.loop import Loop
from coordinator.run.run_context import RunContext
from coordinator.run.session import check_journal
from coordinator.storage.disk import replace_text
from coordinator.storage.folder import RunDetails, RunFolder
from coordinator.storage.journal import Journal
from coordinator.storage.recorder import Recorder
from coordinator.storage.rewriting import rewriting
from coordinator.storage.snapshots import Snapshots
from schema.agent.log import tell_user
from schema.agent.terminal.progress_line import progress_if_long
from schema.errors import RunFolderError
from schema.experiment.file import experiment_from_text, experiment_text, with_births
from schema.tables.description import DETAILS, description_text, read_description
from schema.tables.files import rows_of_island

_TOLD = 256
"""Events between two reports of the progress."""


def lengthen(folder: Path, births: int) -> None:
    """Give a run another number of births on each island; ``resume`` then goes on.

    Its plug-ins must be allowed. If it has this number already, nothing changes.

    Raises:
        ExperimentError: the number is not allowed.
        RunFolderError: the run has more births already, another coordinator has
            locked it, another version began it, or a file is lost or damaged.
    """
    with RunFolder(folder) as held:
        details = held.details
        longer = with_births(details.document, births, str(folder))
        new = replace(details, document=experiment_text(longer))
        if new == details:
            return
        check_journal(folder)
        with (
            Journal.open(folder, epoch=held.epoch) as journal,
            progress_if_long(f"{folder}: repeating the decisions of the run") as tell,
            rewriting(folder) as place,
        ):
            events = journal.replay()
            old_islands, new_islands = (_islands(folder, one) for one in (details, new))
            judged: list[tuple[JournalledEvent, bool]] = []
            for pair in _judged(events, old_islands, new_islands):
                if not len(judged) % _TOLD:
                    tell(f"{folder}: answer {len(judged)} of {len(events)}")
                judged.append(pair)
            born = max(each.births for each in old_islands.islands.values())
            refuse_fewer(folder, births, born)
            _write_description(folder, place, new)
            with Journal.open(place, epoch=held.epoch) as target:
                target.append(event for event, stays in judged if stays)
            _copy_poses(folder, place, new, judged)
    before = experiment_from_text(details.document).births
    void = sum(not stays for _, stays in judged)
    line = f"{folder}: {births} births instead of {before}"
    tell_user(line + (f"; {void} of {len(judged)} answers are void" if void else ""))


def _islands(folder: Path, details: RunDetails) -> Loop:
    """Return the islands of a run, begun; they act on nothing outside."""
    experiment = experiment_from_text(details.document, is_resumed=True)
    context = RunContext.of(str(folder), 0, experiment, details.origin)
    loop = silent_loop(details, context, Snapshots(folder, until=-1))
    loop.begin()
    return loop


def _judged(
    events: Iterable[JournalledEvent], old: Loop, new: Loop
) -> Iterator[tuple[JournalledEvent, bool]]:
    """Yield each event of a journal, and whether it answers the same question anew."""
    for event in events:
        question = old.question(event)
        stays = question is not None and question == new.question(event)
        old.repeat(event)
        if stays:
            new.repeat(event)
        yield event, stays


def refuse_fewer(folder: Path, births: int, born: int) -> None:
    """Raise if a run is to have fewer births than an island of it has already.

    Raises:
        RunFolderError: it is.
    """
    if births < born:
        rule = f"must be >= {born}, the births that the run has"
        raise RunFolderError(f"{folder}: --births: {rule}, got {births}")


def _write_description(folder: Path, place: Path, details: RunDetails) -> None:
    """Write the new description; its time of change stays, when the run began."""
    known = read_description(folder)
    text = description_text(
        structs.replace(known, document=details.document, digests={})
    )
    replace_text(place / DETAILS, text)
    began = (folder / DETAILS).stat().st_mtime_ns
    os.utime(place / DETAILS, ns=(began, began))


def _copy_poses(
    folder: Path,
    place: Path,
    details: RunDetails,
    judged: Iterable[tuple[JournalledEvent, bool]],
) -> None:
    """Copy the poses of advances that stay, one batch each, in the journal's order.

    Behind poses that are lost nothing is copied: the run computes them again.
    """
    sources: dict[int, _IslandRows] = {}
    recorder = Recorder(place, details)
    for event, stays in judged:
        if not isinstance(event, Advanced) or not event.pose_rows:
            continue
        if event.island not in sources:
            sources[event.island] = _IslandRows(folder, event.island)
        rows = sources[event.island].take(event.pose_rows)
        if rows.num_rows < event.pose_rows:
            break
        if stays:
            recorder.add_poses(rows)
    recorder.close()


class _IslandRows:
    """Reader of the poses of one island, in their order."""

    def __init__(self, folder: Path, island: int) -> None:
        self._groups = rows_of_island(folder, "poses", island)
        self._rest: pa.Table | None = None

    def take(self, count: int) -> pa.Table:
        """Return the next rows; fewer if there are no more."""
        parts: list[pa.Table] = []
        missing = count
        while missing and (rows := self._rest or next(self._groups, None)) is not None:
            parts.append(rows.slice(0, missing))
            missing -= parts[-1].num_rows
            self._rest = rows.slice(parts[-1].num_rows)
            if not self._rest.num_rows:
                self._rest = None
        return pa.concat_tables(parts) if parts else pa.table({})
