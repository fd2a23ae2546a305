"""How far a run is by its folder alone, whoever has it in hand."""

from pathlib import Path

import pyarrow.compute

from coordinator.folder import RunDetails, read_details, read_holder, read_state
from schema.experiment import island_count, island_experiment
from schema.experiment_file import experiment_from_text
from schema.run_tables import read_table
from schema.status import IslandStatus, RunStatus


def folder_status(folder: Path) -> RunStatus:
    """Return how far the run of a folder is; "running" only if somebody holds it.

    Raises:
        RunFolderError: no run is there, or a file is damaged.
    """
    details = read_details(folder)
    state: str = read_state(folder)
    if state == "running" and not read_holder(folder):
        state = "stopped"
    counted = pyarrow.compute.value_counts(read_table(folder, "births")["island"])
    born = {item["values"].as_py(): item["counts"].as_py() for item in counted}
    return unbegun_status(folder, details, state=state, born=born)


def unbegun_status(
    folder: Path,
    details: RunDetails,
    *,
    state: str = "waiting",
    born: dict[int, int] | None = None,
) -> RunStatus:
    """Return how far a run is that nobody need have begun.

    Args:
        folder: where it is, or will be, kept.
        details: what it is.
        state: what it is doing.
        born: births so far by island; none if not given.
    """
    experiment = experiment_from_text(details.document)
    islands = []
    for number in range(island_count(experiment)):
        births = (born or {}).get(number, 0)
        wanted = island_experiment(experiment, number).births
        islands.append(
            IslandStatus(births, births if state == "finished" else wanted, None, 0)
        )
    return RunStatus(
        str(folder.resolve()), details.name, details.run, state, islands=tuple(islands)
    )
