"""The recorded evaluation of a robot: what it takes to repeat it alone."""

from collections.abc import Mapping
from typing import Any, NamedTuple

import pyarrow as pa
from msgspec import structs

from schema.experiment.changes import settings_at
from schema.experiment.document import (
    Experiment,
    island_experiment,
    light_of,
    steps_of,
)
from schema.experiment.identity import Identity, Origin
from schema.experiment.settings import (
    EvaluationSettings,
    evaluation_settings_of,
    lasting,
)
from schema.robot.ids import BirthId
from schema.tables.learnt import best_trials
from schema.wire.born import birth_point
from schema.wire.updates import individual


class Recorded(NamedTuple):
    """Trial, time [s] and point of changes of an evaluation; None is unknown."""

    trial: int = 0
    simulated_s: float | None = None
    point: float | None = None


class Repeatable(NamedTuple):
    """What it takes to repeat a recorded evaluation.

    Attributes:
        changing: settings of the robot's island, for an evaluation alone.
        document: these settings at the point of the evaluation.
        settings: of the evaluation, with its duration; of a robot of an arena, of an
            evaluation alone.
        identity: of the evaluation, which determines noise, pushes and disturbances;
            of a robot of an arena, of a first evaluation there.
    """

    changing: Experiment
    document: Experiment
    settings: EvaluationSettings
    identity: Identity


def last_recorded(
    evaluations: pa.Table, learning: pa.Table
) -> dict[tuple[int, BirthId], Recorded]:
    """Return each robot's last evaluation on each island, by island and robot.

    Of a robot that has learnt there it is the first of its best trials.
    """
    learnt = best_trials(learning)
    recorded: dict[tuple[int, BirthId], Recorded] = {}
    for row in evaluations.to_pylist():
        island, birth = row["island"], individual(row)
        own = learnt.get(birth, 0) if island == birth.island else 0
        trial = row["trial"] or own
        recorded[island, birth] = Recorded(trial, row["simulated_s"], row["point"])
    return recorded


def repeatable(
    experiment: Experiment,
    origin: Origin,
    born: Mapping[str, Any],
    recorded: Recorded | None,
) -> Repeatable:
    """Return what it takes to repeat an evaluation.

    Args:
        experiment: of the run.
        origin: run, and island of the evaluation.
        born: row of the births table.
        recorded: the evaluation; None for a robot of an arena.
    """
    trial, simulated_s, point = recorded or Recorded()
    changing = _alone(experiment, origin.island)
    document = settings_at(changing, birth_point(born) if point is None else point)
    settings = evaluation_settings_of(document)
    if simulated_s is not None:
        settings = lasting(settings, steps_of(simulated_s, settings.simulation))
    identity = Identity(origin, BirthId(born["island"], born["birth"]), trial)
    return Repeatable(changing, document, settings, identity)


def _alone(experiment: Experiment, island: int) -> Experiment:
    """Return the settings of one island for an evaluation alone, off-line.

    Robots of an arena start as at their birth, alone and without walls.
    """
    own = island_experiment(experiment, island)
    if own.arena is not None:
        light = light_of(own.environment, own.arena)
        own = structs.replace(
            own,
            simulation=structs.replace(own.simulation, drop_m=own.arena.drop_m),
            environment=structs.replace(own.environment, light=light),
            arena=None,
        )
    return own
