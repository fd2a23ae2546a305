"""Reads the tables of a run, in the form of the messages of a live run."""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc

from schema.errors import RunFolderError
from schema.experiment.document import Experiment
from schema.experiment.file import experiment_from_text
from schema.experiment.identity import Origin
from schema.robot.ids import BirthId
from schema.tables.description import read_description
from schema.tables.files import FINISHED, campaign, read_table
from schema.wire.updates import (
    Update,
    read_birth,
    read_death,
    read_levels,
    read_migrant,
)

CHUNK_S = 20.0
"""Simulated time of the poses that are read and shown at once [s]."""

_BORN = ("island", "birth", "parents", "rank", "body", "sim_time_s")


@dataclass(frozen=True, slots=True)
class Span:
    """Interval of simulated time whose poses are shown [s]."""

    start_s: float
    end_s: float


def read_news(folder: Path) -> Update:
    """Return the contents of a run's tables, except poses.

    Raises:
        RunFolderError: the folder has no run, or a table cannot be read.
    """
    details = _details(folder)
    counts: dict[int, int] = {}
    births = []
    for row in read_table(folder, "births").select(_BORN).to_pylist():
        counts[row["island"]] = counts.get(row["island"], 0) + 1
        births.append(read_birth(row, counts[row["island"]]))
    if not births:
        raise RunFolderError(f"{folder}: no robot has been born yet")
    population = read_table(folder, "population").to_pylist()
    return Update(
        run=str(folder),
        epoch=0,
        sequence=0,
        is_whole=True,
        experiment=details["name"],
        births=tuple(births),
        deaths=tuple(map(read_death, read_table(folder, "deaths").to_pylist())),
        levels=tuple(read_levels(population)),
        migrants=tuple(map(read_migrant, read_table(folder, "migrations").to_pylist())),
        document=details["document"],
    )


def read_experiment(folder: Path) -> Experiment:
    """Return the experiment of a run.

    Raises:
        RunFolderError: the folder has no run, or its description is damaged.
        ExperimentError: its document has another version.
    """
    return experiment_from_text(_details(folder)["document"])


def read_origin(folder: Path) -> Origin:
    """Return seed and number of a run, which determine its noise, for island 0.

    Raises:
        RunFolderError: the folder has no run, or its description is damaged.
    """
    details = _details(folder)
    return Origin(seed=details["seed"], run=details["run"])


def last_time(folder: Path) -> float:
    """Return the last simulated time in the tables of a run [s]."""
    times = [
        pc.max(read_table(folder, table)["sim_time_s"]).as_py() or 0.0
        for table in ("births", "fitness", "deaths")
    ]
    return float(max(times))


def read_poses(folder: Path, span: Span) -> Iterator[tuple[int, pa.Table]]:
    """Yield the poses of a span, in pieces of ``CHUNK_S``.

    Args:
        folder: the run folder.
        span: interval of simulated time.

    Yields:
        Number of an island, and its rows by time.

    Raises:
        RunFolderError: the table cannot be read.
    """
    poses = _within(folder, span)
    times = poses["sim_time_s"].to_numpy()
    chunks = np.floor((times - span.start_s) / CHUNK_S).astype(np.int64)
    for chunk in np.unique(chunks).tolist():
        now = poses.filter(pa.array(chunks == chunk))
        for island in sorted(pc.unique(now["island"]).to_pylist()):
            rows = now.filter(pc.equal(now["island"], island))
            yield island, rows.sort_by("sim_time_s")


def rows_by_robot(poses: pa.Table) -> Iterator[tuple[BirthId, pa.Table]]:
    """Yield each robot's rows of poses in their order, robots ascending."""
    born = poses["island"]
    if "birth_island" in poses.column_names:
        born = pc.coalesce(poses["birth_island"], born)
    islands, numbers = born.to_numpy(), poses["birth"].to_numpy()
    order = np.lexsort((numbers, islands))
    poses = poses.take(order)
    islands, numbers = islands[order], numbers[order]
    is_new = (np.diff(islands) != 0) | (np.diff(numbers) != 0)
    starts = [0, *(np.flatnonzero(is_new) + 1).tolist()] if len(order) else []
    for start, end in zip(starts, [*starts[1:], len(order)], strict=True):
        birth = BirthId(int(islands[start]), int(numbers[start]))
        yield birth, poses.slice(start, end - start)


def _details(folder: Path) -> dict[str, Any]:
    """Return the description of a run.

    Raises:
        RunFolderError: the folder has no run, or its description is damaged.
    """
    found = read_description(folder)
    return {key: getattr(found, key) for key in ("name", "document", "seed", "run")}


def _within(folder: Path, span: Span) -> pa.Table:
    """Return the poses of a span, reading no more than needed."""
    time = pc.field("sim_time_s")
    is_in = (time >= span.start_s) & (time <= span.end_s)
    if (folder / FINISHED).is_dir():
        return campaign(folder, "poses").to_table(filter=is_in)
    return read_table(folder, "poses").filter(is_in)
