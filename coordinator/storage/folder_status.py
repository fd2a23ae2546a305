"""How far a run is by its folder alone, whoever has it in hand."""

from dataclasses import replace
from pathlib import Path

import pyarrow as pa
import pyarrow.compute as pc

from coordinator.storage.folder import RunDetails, read_details, read_state
from coordinator.storage.hints import command
from coordinator.storage.journal import is_begun
from coordinator.storage.lock import read_holder
from schema.errors import RunFolderError
from schema.experiment.document import island_count, island_experiment
from schema.experiment.file import experiment_from_text
from schema.tables.files import has_rows, read_table
from schema.wire.status import IslandStatus, RunStatus


def folder_status(folder: Path) -> RunStatus:
    """Return how far the run of a folder is; "running" only if somebody holds it.

    Raises:
        RunFolderError: no run is there, or a file is damaged or lost.
        ExperimentError: its experiment cannot be read.
    """
    details = read_details(folder)
    state: str = read_state(folder)
    if state == "running" and not read_holder(folder):
        state = "stopped"
    status = unbegun_status(folder, details)
    births = _by_island(read_table(folder, "births").select(["island"]), "count")
    if state == "finished" and not births:
        check_rewritable(folder, details)
        again = command("resume", folder)
        raise RunFolderError(
            f"{folder}: is finished, and its tables are gone; to have them written "
            f"anew: {again}"
        )
    population = read_table(folder, "population").select(
        ["island", "births", "fitness"]
    )
    newest = _by_island(population.select(["island", "births"]), "max")
    islands = []
    for number, island in enumerate(status.islands):
        born = births.get(number, 0)
        is_now = pc.and_(
            pc.equal(population["island"], number),
            pc.equal(population["births"], newest.get(number, -1)),
        )
        living = population.filter(is_now)
        islands.append(
            IslandStatus(
                births=born,
                wanted=born if state == "finished" else island.wanted,
                best=pc.max(living["fitness"]).as_py(),
                alive=living.num_rows,
            )
        )
    return replace(status, state=state, islands=tuple(islands))


def check_rewritable(folder: Path, details: RunDetails) -> None:
    """Raise unless lost tables of a finished run can be written anew.

    The journal has all rows but an arena's poses.

    Args:
        folder: of the run.
        details: what it is.

    Raises:
        RunFolderError: they cannot.
    """
    experiment = experiment_from_text(details.document)
    has_arena = any(
        island_experiment(experiment, number).arena is not None
        for number in range(island_count(experiment))
    )
    if not is_begun(folder) or (has_arena and not has_rows(folder, "poses")):
        raise RunFolderError(
            f"{folder}: is finished, and its tables are gone: put a copy of them in "
            "their place"
        )


def _by_island(table: pa.Table, what: str) -> dict[int, int]:
    """Return, of each island, the count or the maximum of a table's last column."""
    column = table.schema.names[-1]
    grouped = table.group_by("island").aggregate([(column, what)])
    found = grouped[f"{column}_{what}"].to_pylist()
    return dict(zip(grouped["island"].to_pylist(), found, strict=True))


def unbegun_status(folder: Path, details: RunDetails) -> RunStatus:
    """Return how far a run is that nobody has begun.

    Args:
        folder: where it will be kept.
        details: what it is.
    """
    experiment = experiment_from_text(details.document)
    islands = tuple(
        IslandStatus(0, island_experiment(experiment, number).births, None, 0)
        for number in range(island_count(experiment))
    )
    where = str(folder.resolve())
    return RunStatus(where, details.name, details.run, "waiting", islands=islands)
