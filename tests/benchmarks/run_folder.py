"""Folders of runs for tests of the benchmarks."""

from collections.abc import Iterable
from pathlib import Path
from typing import Any

import pyarrow as pa

from schema.experiment.document import Experiment
from schema.experiment.file import experiment_text
from schema.robot.robot import Robot
from schema.tables.columns import BIRTHS, EVALUATIONS, RUNS
from schema.tables.segments import segment_path
from schema.wire.protobuf import encode_robot
from tests.segments import write_segment


def write_run(
    folder: Path,
    experiment: Experiment,
    *,
    births: Iterable[tuple[int, int, Robot]],
    evaluations: Iterable[tuple[int, int, int | None, float, float]],
) -> None:
    """Write the tables of a run that is not finished, with the columns that are read.

    Args:
        folder: of the run.
        experiment: of the run.
        births: island, number and robot of each.
        evaluations: island, number of the birth, island of the birth if it is
            another, simulated time [s] and fitness of each.
    """
    _write(folder, "runs", RUNS, [{"document": experiment_text(experiment)}])
    rows: list[dict[str, Any]] = [
        {"island": island, "birth": number, "robot": encode_robot(robot)}
        for island, number, robot in births
    ]
    _write(folder, "births", BIRTHS, rows)
    names = ("island", "birth", "birth_island", "simulated_s", "fitness")
    rows = [dict(zip(names, values, strict=True)) for values in evaluations]
    _write(folder, "evaluations", EVALUATIONS, rows)


def _write(
    folder: Path, table: str, schema: pa.Schema, rows: list[dict[str, Any]]
) -> None:
    rows = [{"record": number} | row for number, row in enumerate(rows)]
    path = segment_path(folder, table, 0)
    write_segment(path, schema, [pa.RecordBatch.from_pylist(rows, schema)])
