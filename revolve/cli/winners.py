"""Robots of finished runs that commands evaluate again: the best, and the last ones."""

from collections.abc import Iterable
from pathlib import Path
from typing import Any, NamedTuple

import pyarrow as pa
import pyarrow.compute as pc
from msgspec import structs

from analysis.measures.load import read_run, read_tables
from analysis.measures.measures import robots
from analysis.measures.run_tables import RunTables
from revolve.experiment import Experiment, document_of
from revolve.robot import Robot
from revolve.runs import Run as OwnRun
from schema.errors import RunFolderError
from schema.experiment.document import Experiment as Document
from schema.experiment.document import island_experiment, light_of
from schema.experiment.identity import Identity, Origin
from schema.experiment.settings import evaluation_settings_of, lasting
from schema.robot.ids import BirthId
from schema.tables.description import check_folder
from schema.wire.updates import individual


class Chosen(NamedTuple):
    """Robot to evaluate again.

    Attributes:
        row: first columns of its rows: experiment, folder, island, birth, is_best,
            is_last, recorded.
        document: settings of its island, for an evaluation alone that takes as long
            as the recorded one.
        robot: the robot.
        run: its run.
        identity: of the recorded evaluation, which determines noise, pushes and
            disturbances; of a robot of an arena, of a first evaluation there.
    """

    row: dict[str, Any]
    document: Document
    robot: Robot
    run: OwnRun
    identity: Identity


def chosen_robots(folders: Iterable[Path], most: int | None = None) -> list[Chosen]:
    """Return the best robot of each run, and those of its last populations.

    Args:
        folders: of finished runs.
        most: greatest number of robots of a run's last populations, the fittest
            first; None: all.

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
    found = robots(RunTables(tables, islands=run.islands))
    if not found.num_rows:
        raise RunFolderError(f"{folder}: no robot was evaluated")
    best = found["fitness"].to_pylist().index(pc.max(found["fitness"]).as_py())
    last = _last(found, most)
    own = OwnRun(folder)
    births = tables["births"]
    evaluations = {
        (row["island"], individual(row)): (row["trial"], row["simulated_s"])
        for row in tables["evaluations"].to_pylist()
    }
    chosen: list[Chosen] = []
    for number, row in enumerate(found.to_pylist()):
        if not (number in last or number == best):
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
            "is_last": number in last,
            "recorded": row["fitness"],
        }
        there, name = row["island"], BirthId(island, birth)
        origin = Origin(seed=run.seed, run=run.number, island=there)
        trial, simulated_s = evaluations.get((there, name), (0, None))
        identity = Identity(origin, name, trial)
        document = _alone(own.experiment, there, simulated_s)
        chosen.append(Chosen(head, document, robot, own, identity))
    return chosen


def _last(found: pa.Table, most: int | None) -> set[int]:
    """Return the rows of the last populations, the fittest ones if there are more."""
    is_last, fitness = found["is_last"].to_pylist(), found["fitness"].to_pylist()
    rows = [number for number, is_chosen in enumerate(is_last) if is_chosen]
    return set(sorted(rows, key=lambda row: (-fitness[row], row))[:most])


def _alone(experiment: Experiment, island: int, simulated_s: float | None) -> Document:
    """Return the settings of one island for an evaluation alone, off-line.

    Robots of an arena start as at their birth, alone and without walls.

    Args:
        experiment: of the run.
        island: number of the island.
        simulated_s: recorded length of the evaluation; None if it failed, or in an
            arena.
    """
    own = island_experiment(document_of(experiment), island)
    if simulated_s is not None:
        steps = round(simulated_s / own.simulation.timestep_s)
        clock = lasting(evaluation_settings_of(own), steps).simulation
        own = structs.replace(own, simulation=clock)
    if own.arena is not None:
        light = light_of(own.environment, own.arena)
        own = structs.replace(
            own,
            simulation=structs.replace(own.simulation, drop_m=own.arena.drop_m),
            environment=structs.replace(own.environment, light=light),
            arena=None,
        )
    return own
