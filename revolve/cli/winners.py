"""Robots of finished runs that commands evaluate again: the best, and the last ones."""

from collections.abc import Iterable
from pathlib import Path
from typing import Any, NamedTuple

import pyarrow as pa
from msgspec import structs

from analysis.measures.load import read_run, read_tables
from analysis.measures.measures import robots
from analysis.measures.run_tables import RunTables
from revolve.experiment import Experiment, document_of
from revolve.robot import Robot
from revolve.runs import Run as OwnRun
from schema.errors import RunFolderError
from schema.experiment.changes import settings_at
from schema.experiment.document import Experiment as Document
from schema.experiment.document import island_experiment, light_of, steps_of
from schema.experiment.identity import Identity, Origin
from schema.experiment.settings import (
    EvaluationSettings,
    evaluation_settings_of,
    lasting,
)
from schema.robot.ids import BirthId
from schema.tables.description import check_folder
from schema.tables.files import born_as
from schema.tables.last_populations import best_ever, fittest_first
from schema.tables.learnt import best_trials
from schema.wire.born import birth_point
from schema.wire.updates import individual


class Chosen(NamedTuple):
    """Robot to evaluate again.

    Attributes:
        row: first columns of its rows: experiment, folder, island, birth, is_best,
            is_last, recorded.
        document: settings of its island, for an evaluation alone.
        settings: of the recorded evaluation, with its duration; of a robot of an arena,
            of an evaluation alone.
        identity: of the recorded evaluation, which determines noise, pushes and
            disturbances; of a robot of an arena, of a first evaluation there.
        seasons: those settings with the values at each point of the changes.
    """

    row: dict[str, Any]
    document: Document
    settings: EvaluationSettings
    robot: Robot
    identity: Identity
    seasons: dict[float, EvaluationSettings] = {}  # noqa: RUF012 - never changed


def chosen_robots(folders: Iterable[Path], most: int | None = None) -> list[Chosen]:
    """Return the best robot ever of each run, and those of its last populations.

    Of these at most as many of each run, the fittest first and failed ones last.

    Raises:
        RunFolderError: no finished run, or no robot of it was evaluated.
    """
    return [robot for folder in folders for robot in _of_run(folder, most)]


def _of_run(folder: Path, most: int | None) -> list[Chosen]:
    check_folder(folder)
    run = read_run(folder)
    if not run.is_finished:
        raise RunFolderError(
            f"{folder}: the run is {run.state}; 'revolve resume {folder}' finishes it"
        )
    tables, left_out = read_tables(run)
    for each in left_out:
        raise RunFolderError(f"{each.folder}: {each.what}: {each.why}")
    table = robots(RunTables(tables, islands=run.islands))
    if not table.num_rows:
        raise RunFolderError(f"{folder}: no robot was evaluated")
    order, is_last = _fittest_first(table), table["is_last"].to_pylist()
    last = set([row for row in order if is_last[row]][:most])
    first = table.slice(order[0], 1).to_pylist()[0]
    ever = individual(next(best_ever(folder), first))
    own = OwnRun(folder)
    births = tables["births"]
    recorded = _recorded(tables)
    chosen: list[Chosen] = []
    for number, row in enumerate(table.to_pylist()):
        name = BirthId(row["birth_island"], row["birth"])
        if not (number in last or name == ever):
            continue
        (robot,) = own.robots(births.filter(born_as(name)))
        head = {
            "experiment": run.experiment,
            "folder": str(folder),
            "island": name.island,
            "birth": name.number,
            "is_best": name == ever,
            "is_last": number in last,
            "recorded": row["fitness"],
        }
        there = row["island"]
        origin = Origin(seed=run.seed, run=run.number, island=there)
        trial, simulated_s, point = recorded.get((there, name), (0, None, None))
        identity = Identity(origin, name, trial)
        changing = _alone(own.experiment, there)
        if point is None:
            (born,) = births.filter(born_as(name)).to_pylist()
            point = birth_point(born)
        document = settings_at(changing, point)
        settings = evaluation_settings_of(document)
        if simulated_s is not None:
            steps = steps_of(simulated_s, settings.simulation)
            settings = lasting(settings, steps)
        seasons = _seasons(changing, settings)
        chosen.append(Chosen(head, document, settings, robot, identity, seasons))
    return chosen


def _seasons(
    changing: Document, settings: EvaluationSettings
) -> dict[float, EvaluationSettings]:
    """Return settings with the values at each point of one period of the changes."""
    points = sorted({at for change in changing.changes for at in change.at})
    seasons: dict[float, EvaluationSettings] = {}
    for point in points:
        there = evaluation_settings_of(changing, point)
        simulation = structs.replace(
            there.simulation, warmup_steps=settings.simulation.warmup_steps
        )
        seasons[point] = structs.replace(there, simulation=simulation)
    return seasons


def _recorded(
    tables: dict[str, pa.Table],
) -> dict[tuple[int, BirthId], tuple[int, float | None, float | None]]:
    """Return trial, time [s] and point of each robot's last evaluation on each island.

    Of a robot that has learnt there it is the first of its best trials.
    """
    learnt = best_trials(tables["learning"])
    recorded: dict[tuple[int, BirthId], tuple[int, float | None, float | None]] = {}
    for row in tables["evaluations"].to_pylist():
        island, birth = row["island"], individual(row)
        own = learnt.get(birth, 0) if island == birth.island else 0
        trial = row["trial"] or own
        recorded[island, birth] = (trial, row["simulated_s"], row["point"])
    return recorded


def _fittest_first(table: pa.Table) -> list[int]:
    """Return the rows of robots by descending fitness, failed robots last."""
    rows = table.to_pylist()
    keys = [(row["is_failed"], *fittest_first(row)) for row in rows]
    return sorted(range(len(rows)), key=keys.__getitem__)


def _alone(experiment: Experiment, island: int) -> Document:
    """Return the settings of one island for an evaluation alone, off-line.

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
    return own
