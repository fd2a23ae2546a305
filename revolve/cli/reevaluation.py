"""Evaluation of the robots of finished runs once more, by workers, into a table."""

from argparse import Namespace
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Future
from pathlib import Path
from typing import Any, NamedTuple

import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.parquet as pq
from rich.progress import BarColumn, MofNCompleteColumn, TimeRemainingColumn

from analysis.comparison.robustness import Columns, table_of
from analysis.figures.forms import NothingToDraw
from analysis.figures.style import save
from analysis.progress import bars, replaced
from revolve.cli.winners import Chosen
from revolve.evaluation import Result
from revolve.fleet import Fleet
from revolve.robot import Robot
from schema.errors import counted
from schema.experiment.settings import EvaluationSettings
from schema.robot.robot import Robot as PlainRobot
from schema.tables.description import make_folder

Row = dict[str, Any]


class ReevaluationJob(NamedTuple):
    """Evaluation of a robot, or of another one in its place.

    Attributes:
        one: the robot of the run.
        columns: of the row; None for the evaluation without a change, which has no
            row and precedes the others of its robot.
        settings: of the evaluation.
        robot: to evaluate.
    """

    one: Chosen
    columns: Row | None
    settings: EvaluationSettings
    robot: Robot | PlainRobot


def _reevaluated(jobs: Sequence[ReevaluationJob], workers: int) -> Iterator[Row]:
    """Yield a row for each job with columns, in their order; show progress.

    Equal evaluations are computed once.
    """
    robots = counted(len({id(job.one) for job in jobs}), "robot")
    title = f"re-evaluating {robots} {len(jobs)} times in all"
    columns = ("{task.description}", BarColumn(), MofNCompleteColumn())
    with Fleet(workers) as fleet, bars(title, *columns, TimeRemainingColumn()) as bar:
        known: dict[tuple[object, ...], Future[Result]] = {}
        for job in jobs:
            key = job.robot, job.settings, job.one.identity
            if key not in known:
                # Settings of a request; an experiment has no ablation.
                known[key] = fleet._submit(*key)  # noqa: SLF001 - of this package
        undisturbed: float | None = None
        for job in bar.track(jobs, description="re-evaluating"):
            result = known[job.robot, job.settings, job.one.identity].result()
            if job.columns is None:
                undisturbed = result.fitness
                continue
            yield {
                **job.one.row,
                "undisturbed": undisturbed,
                **job.columns,
                "fitness": result.fitness,
                "failure": result.failure,
            }


class Study(NamedTuple):
    """What a command evaluates and writes.

    Attributes:
        name: of its files, without ending.
        columns: of the table.
        summary: returns the line about a run, from its rows.
        figure: returns the figure of the table.
        jobs: returns the evaluations for the command's options.
    """

    name: str
    columns: Columns
    summary: Callable[[pa.Table], str]
    figure: Callable[[pa.Table], Any]
    jobs: Callable[[Namespace], list[ReevaluationJob]]


def write_results(options: Namespace, study: Study) -> None:
    """Evaluate; write a table and its figure; print a line about each run and file.

    An earlier table in the folder is replaced, as the report of ``analyze`` is.

    Raises:
        RunFolderError: no run, an unfinished one, or a folder that cannot be written.
        RevolveError: no worker is left.
    """
    jobs = study.jobs(options)
    stem: Path = options.out / study.name
    make_folder(stem.parent)
    path = stem.with_suffix(".parquet")
    for line in replaced(path, "the table", "its runs and its figure"):
        print(line, flush=True)
    table = table_of(_reevaluated(jobs, options.workers), study.columns)
    pq.write_table(table, path)
    for folder in options.runs:
        own = table.filter(pc.field("folder") == str(folder))
        print(f"{folder}: {study.summary(own)}")
    print(f"{path}: {table.num_rows} evaluations under changes")
    try:
        save(study.figure(table), stem)
    except NothingToDraw as error:
        print(f"left out: figure: {error}")
    else:
        print(f"{stem}.png: figure, also as PDF")
