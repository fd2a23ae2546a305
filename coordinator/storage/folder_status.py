"""Status of a run, read from its folder."""

from collections import Counter
from pathlib import Path

from msgspec.structs import replace

from coordinator.storage.folder import RunDetails, read_details
from coordinator.storage.hints import command
from coordinator.storage.journal import is_begun
from coordinator.storage.lock import read_holder
from schema.errors import RunFolderError
from schema.experiment.document import island_experiments
from schema.experiment.file import experiment_from_text
from schema.tables.columns import TABLES
from schema.tables.description import STATE, read_state
from schema.tables.files import damage_of, has_rows, is_sealed, read_table
from schema.wire.status import IslandStatus, RunStatus


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
    births = Counter(read_table(folder, "births", ["island"])["island"].to_pylist())
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
        for number, island in enumerate(status.islands)
    )
    return replace(status, state=state, islands=islands)


def table_damages(folder: Path) -> list[str]:
    """Return a line about each damaged or lost table of a finished run.

    Raises:
        RunFolderError: the disk fails.
    """
    if not has_rows(folder, "births"):
        return [f"{folder}: is finished, but its tables are missing"]
    return [why for name in TABLES if (why := damage_of(folder, name))]


def check_rewritable(folder: Path) -> None:
    """Raise unless damaged or lost tables of a finished run can be written again.

    The journal determines all rows; those of an arena's poses are computed again.

    Args:
        folder: run folder.

    Raises:
        RunFolderError: the journal is missing, too.
    """
    if not is_begun(folder):
        raise RunFolderError(
            f"{folder}: is finished, but its tables are missing or damaged, and there "
            "is no journal to restore them: put a copy of the tables in their place"
        )


def unbegun_status(folder: Path, details: RunDetails) -> RunStatus:
    """Return the status of a run that has not started.

    Args:
        folder: its future run folder.
        details: description of the run.
    """
    experiment = experiment_from_text(details.document)
    islands = tuple(
        IslandStatus(0, own.births, None, 0) for own in island_experiments(experiment)
    )
    where = str(folder.resolve())
    return RunStatus(where, details.name, details.run, "waiting", islands=islands)
