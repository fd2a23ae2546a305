"""A run with another number of births: what of its journal stays.

An answer stays if the islands ask the same question under the new number. Others are
void, such as what followed in an archipelago when an island had closed, or the last
re-evaluations of a population; the run requests what it needs again. So it
becomes equal to a run that was begun with the new number.
"""

from collections.abc import Iterable
from pathlib import Path

import pyarrow as pa
from msgspec import structs

from coordinator.islands.events import Advanced, JournalledEvent
from coordinator.run.history import begun_loop
from coordinator.run.loop import Loop
from coordinator.run.session import check_journal
from coordinator.storage.folder import RunFolder, write_description
from coordinator.storage.journal import Journal
from coordinator.storage.recorder import Recorder
from coordinator.storage.rewriting import rewriting
from schema.agent.log import tell_user
from schema.agent.progress_line import progress_if_long
from schema.errors import RunFolderError
from schema.experiment.file import experiment_from_text, experiment_text, with_births
from schema.tables.description import RunDetails, read_description
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
        new = structs.replace(details, document=experiment_text(longer))
        if new == details:
            return
        check_journal(folder)
        with (
            Journal.open(folder, epoch=held.epoch) as journal,
            progress_if_long(f"{folder}: repeating the decisions of the run") as tell,
            rewriting(folder) as place,
        ):
            events = journal.replay()
            old_islands, new_islands = begun_loop(details), begun_loop(new)
            judged: list[tuple[JournalledEvent, bool]] = []
            for number, event in enumerate(events):
                if not number % _TOLD:
                    tell(f"{folder}: answer {number} of {len(events)}")
                judged.append((event, _stays(event, old_islands, new_islands)))
            born = max(each.births for each in old_islands.islands.values())
            refuse_fewer(folder, births, born)
            known = read_description(folder)
            known = structs.replace(known, document=new.document, digests={})
            write_description(folder, known, place)
            with Journal.open(place, epoch=held.epoch) as target:
                target.append(event for event, stays in judged if stays)
            _copy_poses(folder, place, new, judged)
    before = experiment_from_text(details.document).births
    void = sum(not stays for _, stays in judged)
    line = f"{folder}: {births} births instead of {before}"
    tell_user(line + (f"; {void} of {len(judged)} answers are void" if void else ""))


def _stays(event: JournalledEvent, old: Loop, new: Loop) -> bool:
    """Repeat an event; return whether it answers the same question in both."""
    question = old.question(event)
    stays = question is not None and question == new.question(event)
    old.repeat(event)
    if stays:
        new.repeat(event)
    return stays


def refuse_fewer(folder: Path, births: int, born: int) -> None:
    """Raise ``RunFolderError`` if an island has more births than a run is to have."""
    if births < born:
        rule = f"must be >= {born}, the births that the run has"
        raise RunFolderError(f"{folder}: --births: {rule}, got {births}")


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
            recorder.poses.add(rows)
    recorder.close()


class _IslandRows:
    """Reader of the poses of one island, in their order."""

    def __init__(self, folder: Path, island: int) -> None:
        self._groups = rows_of_island(folder, "poses", island)
        self._rest: pa.Table | None = None

    def take(self, count: int) -> pa.Table:
        """Return the next rows; fewer if there are no more."""
        parts: list[pa.Table] = []
        while count and (rows := self._rest or next(self._groups, None)):
            parts.append(rows.slice(0, count))
            count -= len(parts[-1])
            self._rest = rows.slice(len(parts[-1]))
        return pa.concat_tables(parts) if parts else pa.table({})
