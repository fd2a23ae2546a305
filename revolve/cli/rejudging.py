"""Re-evaluation of the robots of finished runs under changes of the simulation."""

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

import pyarrow.compute as pc
import pyarrow.parquet as pq
from msgspec import structs
from rich.progress import BarColumn, MofNCompleteColumn, TimeRemainingColumn

from analysis.comparison.robustness import Row, summary, table_of
from analysis.figures.forms import NothingToDraw
from analysis.figures.robustness import robustness
from analysis.figures.style import save
from analysis.measures.load import read_run, read_tables
from analysis.measures.measures import robots
from analysis.measures.run_tables import RunTables
from analysis.progress import bars
from revolve.experiment import Experiment, document_of
from revolve.fleet import Fleet
from revolve.robot import Robot
from revolve.runs import Run as OwnRun
from schema.errors import RunFolderError, counted
from schema.experiment.document import Experiment as Document
from schema.experiment.document import island_experiment, light_of
from schema.experiment.settings import evaluation_settings_of
from schema.tables.description import check_folder, make_folder
from worker.robot.robustness import all_changes

TABLE, FIGURE = "robustness.parquet", "robustness"


def rejudge_runs(folders: Sequence[Path], out: Path, workers: int) -> None:
    """Re-evaluate robots of runs; write the table and the figure, print a line each.

    Args:
        folders: of finished runs.
        out: folder to write to.
        workers: worker processes on this machine.

    Raises:
        RunFolderError: no run, an unfinished one, or a folder that cannot be written.
        RevolveError: no worker is left.
    """
    chosen = [robot for folder in folders for robot in _chosen(folder)]
    make_folder(out)
    table = table_of(_rejudged(chosen, workers))
    pq.write_table(table, out / TABLE)
    for folder in folders:
        own = table.filter(pc.field("folder") == str(folder))
        print(f"{folder}: {summary(own)}")
    print(f"{out / TABLE}: {table.num_rows} evaluations under changes")
    try:
        save(robustness(table), out / FIGURE)
    except NothingToDraw as error:
        print(f"left out: figure: {error}")
    else:
        print(f"{out / FIGURE}.png: figure, also as PDF")


class _Chosen(NamedTuple):
    """A robot to re-evaluate: its row in the table, its settings, and itself."""

    row: Row
    document: Document
    robot: Robot


def _chosen(folder: Path) -> list[_Chosen]:
    """Return the robots of a run's last population, and its best one.

    Raises:
        RunFolderError: no finished run, or no robot of it was evaluated.
    """
    check_folder(folder)
    run = read_run(folder)
    if not run.is_finished:
        raise RunFolderError(
            f"{folder}: the run is {run.state}; 'revolve resume {folder}' finishes it"
        )
    tables, left_out = read_tables(run)
    for each in left_out:
        raise RunFolderError(f"{each.folder}: {each.what}: {each.why}")
    found = robots(RunTables(tables))
    if not found.num_rows:
        raise RunFolderError(f"{folder}: no robot was evaluated")
    best = found["fitness"].to_pylist().index(pc.max(found["fitness"]).as_py())
    own = OwnRun(folder)
    births = tables["births"]
    chosen: list[_Chosen] = []
    for number, row in enumerate(found.to_pylist()):
        if not (row["is_last"] or number == best):
            continue
        island, birth = row["birth_island"], row["birth"]
        is_own = pc.and_(
            pc.equal(births["island"], island), pc.equal(births["birth"], birth)
        )
        (robot,) = own.robots(births.filter(is_own))
        head = {
            "experiment": run.experiment,
            "folder": str(folder),
            "island": island,
            "birth": birth,
            "is_best": number == best,
            "is_last": row["is_last"],
            "recorded": row["fitness"],
        }
        chosen.append(_Chosen(head, _alone(own.experiment, island), robot))
    return chosen


def _alone(experiment: Experiment, island: int) -> Document:
    """Return the settings of one island for an evaluation without disturbances.

    Robots of an arena start as at their birth, alone and without walls.
    """
    own = island_experiment(document_of(experiment), island)
    if own.arena is not None:
        light = light_of(own.environment, own.arena)
        own = structs.replace(
            own,
            simulation=structs.replace(own.simulation, drop_m=own.arena.drop_m),
            environment=structs.replace(own.environment, light=light),
            arena=None,
        )
    return structs.replace(own, robust=None)


def _rejudged(chosen: list[_Chosen], workers: int) -> Iterator[Row]:
    """Yield a row for each robot and change, with all shares still missing."""
    jobs: list[tuple[_Chosen, str, str, Experiment]] = []
    for one in chosen:
        jobs.append((one, "", "", Experiment(one.document)))
        for change in all_changes(evaluation_settings_of(one.document)):
            changed = structs.replace(
                one.document,
                simulation=change.settings.simulation,
                environment=change.settings.environment,
                robust=change.settings.robust,
            )
            jobs.append((one, change.group, change.name, Experiment(changed)))
    title = f"re-evaluating {counted(len(chosen), 'robot')} {len(jobs)} times in all"
    columns = ("{task.description}", BarColumn(), MofNCompleteColumn())
    with Fleet(workers) as fleet, bars(title, *columns, TimeRemainingColumn()) as bar:
        futures = [fleet.submit(one.robot, changed) for one, _, _, changed in jobs]
        undisturbed: float | None = None
        for (one, group, name, _), future in bar.track(
            list(zip(jobs, futures, strict=True)), description="re-evaluating"
        ):
            result = future.result()
            if not group:
                undisturbed = result.fitness
                continue
            yield {
                **one.row,
                "undisturbed": undisturbed,
                "group": group,
                "change": name,
                "fitness": result.fitness,
                "failure": result.failure,
            }
