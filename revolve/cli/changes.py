"""Re-evaluation of the robots of finished runs under changes, or without some parts."""

from argparse import Namespace
from collections.abc import Iterator, Sequence
from concurrent.futures import Future
from pathlib import Path
from types import ModuleType
from typing import Any, NamedTuple

import pyarrow.compute as pc
import pyarrow.parquet as pq
from msgspec.structs import replace
from rich.progress import BarColumn, MofNCompleteColumn, TimeRemainingColumn

from analysis.comparison import ablation, robustness
from analysis.comparison.robustness import table_of
from analysis.figures import changes
from analysis.figures.forms import NothingToDraw
from analysis.figures.style import save
from analysis.progress import bars, replaced
from coordinator.evolution.generation import random_brain
from coordinator.evolution.random_streams import Purpose, stream
from revolve.cli.winners import Chosen, chosen_robots
from revolve.evaluation import Result
from revolve.fleet import Fleet
from revolve.robot import Robot, plain
from schema.errors import counted
from schema.experiment.document import REVOLVE_ANGLE, body_space
from schema.experiment.settings import EvaluationSettings
from schema.robot.robot import Robot as PlainRobot
from schema.tables.description import make_folder
from worker.filters.channels import all_ablations
from worker.robot.robustness import all_changes

Row = dict[str, Any]

_OF_ABLATION = ("group", "scope", "kind", "part", "channel")


class ReevaluationJob(NamedTuple):
    """Evaluation of a robot of a run, or of another robot in its place.

    The evaluation without a change has no row, and so no columns; it precedes the
    others of its robot.
    """

    one: Chosen
    columns: Row | None
    settings: EvaluationSettings
    robot: Robot | PlainRobot


def _reevaluated(jobs: Sequence[ReevaluationJob], workers: int | None) -> Iterator[Row]:
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


def write_results(command: str, options: Namespace) -> None:
    """Evaluate; write a table and its figure; print a line about each run and file.

    An earlier table in the folder is replaced, as the report of ``analyze`` is.

    Raises:
        RunFolderError: no run, an unfinished one, or a folder that cannot be written.
        RevolveError: no worker is left.
    """
    is_ablation = command == "ablate"
    study: ModuleType = ablation if is_ablation else robustness
    if is_ablation:
        wanted = _ablation_jobs(options)
    else:
        wanted = [job for one in chosen_robots(options.runs) for job in _changes(one)]
    stem: Path = options.out / ("ablation" if is_ablation else command)
    make_folder(stem.parent)
    path = stem.with_suffix(".parquet")
    for line in replaced(path, "the table", "its runs and its figure"):
        print(line, flush=True)
    table = table_of(_reevaluated(wanted, options.workers), study.COLUMNS)
    pq.write_table(table, path)
    for folder in options.runs:
        own = table.filter(pc.field("folder") == str(folder))
        print(f"{folder}: {study.summary(own)}")
    print(f"{path}: {table.num_rows} evaluations under changes")
    try:
        save((changes.ablation if is_ablation else changes.robustness)(table), stem)
    except NothingToDraw as error:
        print(f"left out: figure: {error}")
    else:
        print(f"{stem}.png: figure, also as PDF")


def _ablation_jobs(options: Namespace) -> list[ReevaluationJob]:
    chosen = chosen_robots(options.runs, options.robots)
    for name in dict.fromkeys(one.document.encoding.type for one in chosen):
        if options.brains and name != REVOLVE_ANGLE:
            print(
                f"left out: random brains: encoding {name!r} makes body and brain of "
                "one genome"
            )
    return [job for one in chosen for job in _ablations(one, options.brains)]


def _changes(one: Chosen) -> Iterator[ReevaluationJob]:
    """Yield the evaluations of a robot, without ``[robust]``."""
    settings = replace(one.settings, robust=None)
    yield ReevaluationJob(one, None, settings, one.robot)
    for point, season in one.seasons.items():
        columns = {"group": "changes", "change": f"changes at {point:g}"}
        elsewhere = replace(season, robust=None)
        yield ReevaluationJob(one, columns, elsewhere, one.robot)
    for change in all_changes(settings):
        columns = {"group": change.group, "change": change.name}
        yield ReevaluationJob(one, columns, change.settings, one.robot)


def _ablations(one: Chosen, brains: int) -> Iterator[ReevaluationJob]:
    """Yield the evaluations of a robot, and of its body with some random brains."""
    settings, robot = one.settings, plain(one.robot)
    yield ReevaluationJob(one, None, settings, robot)
    for change in all_ablations(robot, body_space(settings.space)):
        columns = {name: getattr(change, name) for name in _OF_ABLATION}
        columns["change"] = change.name
        ablated = replace(settings, ablation=change.ablation)
        yield ReevaluationJob(one, columns, ablated, robot)
    # Other encodings make body and brain of one genome.
    if one.document.encoding.type != REVOLVE_ANGLE:
        return
    origin, birth = one.identity.origin, one.identity.birth
    for number in range(brains):
        rng = stream(origin.seed, origin.run, birth, number, Purpose.OTHER_BRAIN)
        values = (ablation.RANDOM, "one", "", None, number)
        columns = dict(zip(_OF_ABLATION, values, strict=True))
        columns["change"] = f"random brain {number + 1}"
        other = random_brain(rng, robot, one.document)
        yield ReevaluationJob(one, columns, settings, other)
