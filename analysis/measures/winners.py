"""What the best robot of a run sustains: its fitness after the window that selected it.

The best robot is the fittest of the last populations, simulated alone.
"""

from collections.abc import Callable, Mapping

import pyarrow as pa
import pyarrow.compute as pc
from msgspec.structs import replace

from analysis.measures.load import LoadedRun
from schema.errors import FAILURES
from schema.experiment.file import experiment_from_text
from schema.experiment.identity import Identity, Origin
from schema.experiment.settings import EvaluationSettings, later_windows
from schema.robot.ids import BirthId
from schema.robot.results import Evaluation, later_fitness, sustained
from schema.robot.robot import Robot
from schema.tables.description import allow_plugins_of
from schema.tables.files import born_as
from schema.tables.last_populations import best_of
from schema.wire.born import robot_of_birth
from schema.wire.recorded import last_recorded, repeatable
from schema.wire.updates import individual

Evaluate = Callable[[Robot, EvaluationSettings, Identity], Evaluation]
"""The worker's evaluation of a robot."""


LATER = ("later_fitness", "sustained")
"""Columns of the table ``robots`` that only the best robot of a run has."""


def with_later_windows(
    robots: pa.Table, run: LoadedRun, tables: Mapping[str, pa.Table], evaluate: Evaluate
) -> pa.Table:
    """Return the table ``robots`` with what the run's best robot does in later windows.

    ``tables`` are those of ``read_tables``.

    Raises:
        RevolveError: the robot cannot be simulated.
    """
    is_judged = pc.field("is_last") & ~pc.field("is_failed")
    best = best_of(robots.filter(is_judged).to_pylist())
    if best is None:
        return robots
    name = individual(best)
    first, *later = _windows(run, tables, name, best["island"], evaluate)
    values = later_fitness(later), sustained(first, later)
    homes, births = (robots[key] for key in ("birth_island", "birth"))
    is_best = pc.and_(pc.equal(homes, name.island), pc.equal(births, name.number))
    for key, value in zip(LATER, values, strict=True):
        column = pc.if_else(is_best, pa.scalar(value, pa.float64()), None)
        robots = robots.set_column(robots.schema.get_field_index(key), key, column)
    return robots


def _windows(
    run: LoadedRun,
    tables: Mapping[str, pa.Table],
    name: BirthId,
    island: int,
    evaluate: Evaluate,
) -> list[float | None]:
    """Return the fitness of a robot in the window of its evaluation and later ones.

    It is evaluated alone, as on an island of the run.
    """
    allow_plugins_of(run.folder)
    experiment = experiment_from_text(run.document, is_own=True)
    (born,) = tables["births"].filter(born_as(name)).to_pylist()
    recorded = last_recorded(tables["evaluations"], tables["learning"])
    own = repeatable(
        experiment,
        Origin(seed=run.seed, run=run.number, island=island),
        born,
        recorded.get((island, name)),
    )
    robot = robot_of_birth(born["genome"], born["robot"], experiment)

    def fitness(settings: EvaluationSettings) -> float | None:
        try:
            return evaluate(robot, settings, own.identity).fitness
        except FAILURES:
            return None

    settings = replace(own.settings, robust=None)
    return [*map(fitness, (settings, *later_windows(settings)))]


def sustained_shares(robots: pa.Table) -> dict[tuple[str, int], float]:
    """Return what best robots sustain, by run folder and island."""
    rows = robots.filter(pc.field("sustained").is_valid()).to_pylist()
    return {(row["folder"], row["island"]): row["sustained"] for row in rows}
