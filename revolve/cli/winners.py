"""Robots of finished runs that commands evaluate again: the best, and the last ones."""

from collections.abc import Iterable
from pathlib import Path
from typing import Any, NamedTuple

from msgspec.structs import replace

from analysis.measures.load import read_run, read_tables
from analysis.measures.measures import robots
from analysis.measures.run_tables import RunTables
from revolve.experiment import document_of
from revolve.robot import Robot
from revolve.runs import Run as OwnRun
from schema.errors import RunFolderError
from schema.experiment.document import Experiment as Document
from schema.experiment.identity import Identity, Origin
from schema.experiment.settings import EvaluationSettings, evaluation_settings_of
from schema.robot.ids import BirthId
from schema.tables.description import check_folder
from schema.tables.files import born_as
from schema.tables.last_populations import best_ever, fittest_first
from schema.wire.recorded import last_recorded, repeatable
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
    rows = table.to_pylist()
    order = _fittest_first(rows)
    last = set([number for number in order if rows[number]["is_last"]][:most])
    ever = individual(next(best_ever(folder), rows[order[0]]))
    own = OwnRun(folder)
    births = tables["births"]
    recorded = last_recorded(tables["evaluations"], tables["learning"])
    chosen: list[Chosen] = []
    for number, row in enumerate(rows):
        name = BirthId(row["birth_island"], row["birth"])
        if not (number in last or name == ever):
            continue
        birth = births.filter(born_as(name))
        (robot,) = own.robots(birth)
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
        changing, document, settings, identity = repeatable(
            document_of(own.experiment),
            origin,
            birth.to_pylist()[0],
            recorded.get((there, name)),
        )
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
        simulation = replace(
            there.simulation, warmup_steps=settings.simulation.warmup_steps
        )
        seasons[point] = replace(there, simulation=simulation)
    return seasons


def _fittest_first(rows: list[dict[str, Any]]) -> list[int]:
    """Return the numbers of robots by descending fitness, failed robots last."""
    keys = [(row["is_failed"], *fittest_first(row)) for row in rows]
    return sorted(range(len(rows)), key=keys.__getitem__)
