"""Reads the tables of a run, in the form of the messages of a live run."""

import argparse
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc

from analysis.measures.load import LoadedRun, has_rules, read_run
from analysis.viewer.body import numbers_of
from schema.errors import RevolveError, RunFolderError
from schema.experiment.document import Experiment
from schema.experiment.file import experiment_from_text
from schema.robot.ids import BirthId
from schema.robot.trace import Floats
from schema.tables.description import allow_plugins_of
from schema.tables.files import read_table
from schema.wire.elites import EliteReader
from schema.wire.updates import (
    SAMPLED,
    Update,
    arenas_of,
    read_birth,
    read_death,
    read_levels,
    read_migrant,
    read_samples,
)

CHUNK_S = 20.0
"""Simulated time of the poses that are read and shown at once [s]."""

_BORN = ("island", "birth", "parents", "rank", "body", "sim_time_s")


def read_past(folder: Path) -> tuple[LoadedRun, Experiment, Update]:
    """Return a run, its experiment, whose plug-ins are allowed, and ``read_news``.

    Raises:
        RunFolderError: as of ``read_run`` and ``read_news``.
    """
    run = read_run(folder)
    allow_plugins_of(folder)
    return run, experiment_from_text(run.document, is_own=True), read_news(run)


def read_news(run: LoadedRun) -> Update:
    """Return the contents of a run's tables, except poses.

    Raises:
        RunFolderError: a table cannot be read, or no robot has been born.
    """
    folder = run.folder
    counts: dict[int, int] = {}
    births = []
    for row in read_table(folder, "births", _BORN).to_pylist():
        counts[row["island"]] = counts.get(row["island"], 0) + 1
        births.append(read_birth(row, counts[row["island"]]))
    if not births:
        raise RunFolderError(f"{folder}: no robot has been born yet")
    population = read_table(folder, "population").to_pylist()
    elites = EliteReader(run.document)
    return Update(
        run=str(folder),
        epoch=0,
        sequence=0,
        is_whole=True,
        experiment=run.experiment,
        births=tuple(births),
        deaths=tuple(map(read_death, read_table(folder, "deaths").to_pylist())),
        levels=tuple(read_levels(population, arenas_of(births))),
        migrants=tuple(map(read_migrant, read_table(folder, "migrations").to_pylist())),
        samples=tuple(
            read_samples(
                (name, row)
                for name in (SAMPLED if any(map(has_rules, run.islands)) else ())
                for row in read_table(folder, name).to_pylist()
            )
        ),
        document=run.document,
        elites=tuple(
            elite
            for name in (("evaluations", "fitness") if elites.grid else ())
            for row in read_table(folder, name).to_pylist()
            if (elite := elites.read(name, row))
        ),
    )


def last_time(folder: Path) -> float:
    """Return the last simulated time in the tables of a run [s]."""
    times = [
        pc.max(read_table(folder, table, ["sim_time_s"])["sim_time_s"]).as_py() or 0.0
        for table in ("births", "fitness", "deaths")
    ]
    return float(max(times))


def span_of(
    options: argparse.Namespace, last_s: float, error: type[RevolveError]
) -> tuple[float, float]:
    """Return the simulated time to show, of the flags of ``revolve view`` [s].

    By default it is ``last_s`` at the end of the run. The error is raised if the span
    ends before it starts.
    """
    end_s = last_time(options.run) if options.until is None else options.until
    start_s = max(0.0, end_s - last_s) if options.start is None else options.start
    if start_s > end_s:
        raise error(f"--from {start_s:g}: must be before {end_s:g} s")
    return start_s, end_s


def read_poses(
    folder: Path, start_s: float, end_s: float
) -> Iterator[tuple[int, pa.Table]]:
    """Yield islands and their poses in a span, by time, in pieces of ``CHUNK_S``.

    Raises:
        RunFolderError: the table cannot be read.
    """
    time = pc.field("sim_time_s")
    is_in = (time >= start_s) & (time <= end_s)
    poses = read_table(folder, "poses", where=is_in)
    times = poses["sim_time_s"].to_numpy()
    chunks = np.floor((times - start_s) / CHUNK_S).astype(np.int64)
    for chunk in np.unique(chunks).tolist():
        now = poses.filter(pa.array(chunks == chunk))
        for island in sorted(pc.unique(now["island"]).to_pylist()):
            rows = now.filter(pc.equal(now["island"], island))
            yield island, rows.sort_by("sim_time_s")


def frames_of(poses: pa.Table) -> dict[float, dict[BirthId, Floats]]:
    """Return x, y, z, w, x, y, z and angles of each robot, by time, ascending."""
    frames: dict[float, dict[BirthId, Floats]] = {}
    for birth, rows in rows_by_robot(poses):
        times = rows["sim_time_s"].to_pylist()
        for time_s, pose in zip(times, np.hstack(numbers_of(rows)), strict=True):
            frames.setdefault(time_s, {})[birth] = pose
    return dict(sorted(frames.items()))


def rows_by_robot(poses: pa.Table) -> Iterator[tuple[BirthId, pa.Table]]:
    """Yield each robot's rows of poses in their order, robots ascending."""
    born = poses["island"]
    if "birth_island" in poses.column_names:
        born = pc.coalesce(poses["birth_island"], born)
    ids = np.stack([born.to_numpy(), poses["birth"].to_numpy()], axis=1)
    robots, robot_of = np.unique(ids, axis=0, return_inverse=True)
    order = np.argsort(robot_of, kind="stable")
    counts = np.bincount(robot_of, minlength=len(robots))
    ends = np.cumsum(counts)
    for robot, start, count in zip(robots.tolist(), ends - counts, counts, strict=True):
        yield BirthId(*robot), poses.take(order[start : start + count])
