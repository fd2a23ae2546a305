"""Status of runs, read from their folders."""

from collections import Counter
from pathlib import Path

from msgspec.structs import replace

from coordinator.storage.campaign import CAMPAIGN, read_campaign
from coordinator.storage.folder import EPOCH, holds_run, read_details
from coordinator.storage.hints import command
from coordinator.storage.journal import NAME as JOURNAL
from coordinator.storage.journal import is_begun
from coordinator.storage.lock import LOCK, read_holder
from schema.agent.log import tell_user
from schema.errors import RevolveError, RunFolderError
from schema.experiment.document import island_experiments
from schema.experiment.file import experiment_from_text
from schema.tables.columns import TABLES
from schema.tables.description import (
    DETAILS,
    STATE,
    RunDetails,
    check_folder,
    read_state,
)
from schema.tables.files import damage_of, has_rows, is_sealed, read_table
from schema.tables.segments import FINISHED, SEGMENTS
from schema.wire.status import IslandStatus, RunStatus, Status


def folder_status(folder: Path) -> RunStatus:
    """Return the status of a folder's run; "running" only if a process has locked it.

    Raises:
        RunFolderError: there is no run, or a file is damaged or missing.
        ExperimentError: its experiment cannot be read.
    """
    details = read_details(folder)
    state: str = read_state(folder)
    if state == "running" and not read_holder(folder):
        state = "stopped"
    status = unbegun_status(folder, details)
    if state == "finished" and not is_sealed(folder):
        raise RunFolderError(
            f"{folder / STATE}: damaged: is {state!r}, but the run has no finished "
            f"tables; to continue it: {command('resume', folder)}"
        )
    if state == "finished" and not has_rows(folder, "births"):
        check_rewritable(folder)
        raise RunFolderError(
            f"{folder}: is finished, but its tables are missing; to write them again: "
            f"{command('resume', folder)}"
        )
    births = births_of(folder)
    names = ["island", "births", "fitness"]
    populations = read_table(folder, "population", names).group_by(names[:2])
    summaries = populations.aggregate([("fitness", "max"), ([], "count_all")])
    newest = {row["island"]: row for row in summaries.sort_by("births").to_pylist()}
    islands = tuple(
        IslandStatus(
            births=births[number],
            wanted=births[number] if state == "finished" else island.wanted,
            best=newest.get(number, {}).get("fitness_max"),
            alive=newest.get(number, {}).get("count_all", 0),
        )
        for number, island in status.numbered
    )
    return replace(status, state=state, islands=islands)


def births_of(folder: Path) -> Counter[int]:
    """Return the number of births of each island of a run."""
    return Counter(read_table(folder, "births", ["island"])["island"].to_pylist())


def status_below(folder: Path) -> Status:
    """Return the status of all runs at or below a folder, read from disk.

    Raises:
        RunFolderError: there is no run and no campaign.
    """
    check_folder(folder)
    planned: dict[Path, RunDetails] = {}
    runs: list[RunStatus] = []
    for path in _below(folder, CAMPAIGN):
        try:
            planned.update(read_campaign(path).runs(path))
        except RunFolderError as error:
            runs.append(_damaged(path, error))
    others = [path for path in _below(folder, DETAILS) if path not in planned]
    for path in (*planned, *filter(_is_ours, others)):
        try:
            is_begun = path not in planned or holds_run(path)
            runs.append(
                folder_status(path) if is_begun else unbegun_status(path, planned[path])
            )
        except RevolveError as error:
            runs.append(_damaged(path, error))
    if not runs:
        raise RunFolderError(
            f"{folder}: no run and no campaign in this folder or below"
        )
    return Status(tuple(runs), 0, 0, 0.0)


def _below(folder: Path, name: str) -> list[Path]:
    """Return the folders at any depth that hold a file of a name.

    Symbolic links are followed one level deep only: deeper ones may form a cycle.
    """
    found = {*folder.glob(f"**/{name}"), *folder.glob(f"*/{name}")}
    return sorted(path.parent for path in found)


def _is_ours(folder: Path) -> bool:
    """Return whether a folder with a ``run.json`` has any other file of a run."""
    names = (LOCK, EPOCH, JOURNAL, SEGMENTS, FINISHED)
    return any((folder / name).exists() for name in names)


def _damaged(folder: Path, error: RevolveError) -> RunStatus:
    """Report what is wrong with a folder; return a status without any counts."""
    tell_user(f"damaged: {error}")
    return RunStatus(str(folder.resolve()), folder.name, 0, "damaged")


def table_damages(folder: Path) -> list[str]:
    """Return a line about each damaged or lost table of a finished run."""
    if not has_rows(folder, "births"):
        return [f"{folder}: is finished, but its tables are missing"]
    return [why for name in TABLES if (why := damage_of(folder, name))]


def check_rewritable(folder: Path) -> None:
    """Raise ``RunFolderError`` unless tables of a finished run can be written again.

    The journal determines all rows; those of an arena's poses are computed again.
    """
    if not is_begun(folder):
        raise RunFolderError(
            f"{folder}: is finished, but its tables are missing or damaged, and there "
            "is no journal to restore them: put a copy of the tables in their place"
        )


def unbegun_status(folder: Path, details: RunDetails) -> RunStatus:
    """Return the status of a run that has not started."""
    experiment = experiment_from_text(details.document)
    owns, group = island_experiments(experiment), details.group
    islands = tuple(
        IslandStatus(0, owns[number].births, None, 0)
        for number in group.islands(len(owns))
    )
    where, name = str(folder.resolve()), details.name
    return RunStatus(where, name, details.run, "waiting", islands=islands, group=group)
