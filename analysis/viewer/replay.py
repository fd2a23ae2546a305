"""What the tables of a run tell, in the form in which it is told live."""

import json
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
from schema.tables.files import FINISHED, campaign, read_table
from schema.wire.updates import (
    Update,
    read_birth,
    read_death,
    read_levels,
    read_migrant,
)

CHUNK_S = 20.0
"""Simulated time that is read and shown at once [s]."""

_DETAILS = "run.json"
_BORN = ("island", "birth", "parents", "rank", "body", "sim_time_s")


@dataclass(frozen=True, slots=True)
class Span:
    """Simulated time from which poses are shown, and until when [s]."""

    start_s: float
    end_s: float


def read_news(folder: Path) -> Update:
    """Return all that a run's tables tell, but for poses.

    Raises:
        RunFolderError: no run is there, or a table cannot be read.
    """
    details = _details(folder)
    counts: dict[int, int] = {}
    births = []
    for row in read_table(folder, "births").select(_BORN).to_pylist():
        counts[row["island"]] = counts.get(row["island"], 0) + 1
        births.append(read_birth(row, counts[row["island"]]))
    if not births:
        raise RunFolderError(f"{folder}: nobody has been born yet")
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
        RunFolderError: no run is there.
        ExperimentError: its document is of another version.
    """
    return experiment_from_text(_details(folder)["document"])


def read_origin(folder: Path) -> Origin:
    """Return what the noise of a run was drawn by, on its island 0.

    Raises:
        RunFolderError: no run is there.
    """
    details = _details(folder)
    return Origin(seed=details["seed"], run=details["run"])


def last_time(folder: Path) -> float:
    """Return the newest simulated time of a run that its tables know of [s]."""
    times = [
        pc.max(read_table(folder, table)["sim_time_s"]).as_py() or 0.0
        for table in ("births", "fitness", "deaths")
    ]
    return float(max(times))


def read_poses(folder: Path, span: Span) -> Iterator[tuple[int, pa.Table]]:
    """Return the poses of a span, arena by arena and bit by bit.

    Args:
        folder: the run folder.
        span: which simulated time.

    Returns:
        Numbers of islands, and their rows by time.

    Raises:
        RunFolderError: the table cannot be read.
    """
    poses = _within(folder, span)
    times = poses["sim_time_s"].to_numpy()
    bits = np.floor((times - span.start_s) / CHUNK_S).astype(np.int64)
    for bit in np.unique(bits).tolist():
        now = poses.filter(pa.array(bits == bit))
        for island in sorted(pc.unique(now["island"]).to_pylist()):
            rows = now.filter(pc.equal(now["island"], island))
            yield island, rows.sort_by("sim_time_s")


def _details(folder: Path) -> dict[str, Any]:
    """Return what a run folder says of its run.

    Raises:
        RunFolderError: no run is there.
    """
    try:
        details: dict[str, Any] = json.loads((folder / _DETAILS).read_text("utf-8"))
        texts = {key: str(details[key]) for key in ("name", "document")}
        return {**texts, **{key: int(details[key]) for key in ("seed", "run")}}
    except OSError as error:
        why = f"{_DETAILS}: {error.strerror}"
    except (ValueError, KeyError, TypeError) as error:
        why = f"{_DETAILS}: {error}"
    raise RunFolderError(f"{folder}: no run is there: {why}")


def _within(folder: Path, span: Span) -> pa.Table:
    """Return the poses of a span, reading no more than needed."""
    time = pc.field("sim_time_s")
    is_in = (time >= span.start_s) & (time <= span.end_s)
    if (folder / FINISHED).is_dir():
        return campaign(folder, "poses").to_table(filter=is_in)
    return read_table(folder, "poses").filter(is_in)
