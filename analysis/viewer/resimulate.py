"""Full motion of selected robots: simulates them again and compares the results.

The simulators are passed in, because rooms do not import each other.
"""

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import pyarrow as pa
import pyarrow.compute as pc

from analysis.measures.load import LoadedRun
from analysis.viewer.motion import Motion
from analysis.viewer.recording import ViewerError
from schema.agent.machine import platform_tag
from schema.experiment.document import Experiment, island_experiment
from schema.experiment.file import experiment_from_text
from schema.experiment.identity import Identity, Origin
from schema.experiment.settings import EvaluationSettings
from schema.robot.ids import BirthId
from schema.robot.results import Evaluation
from schema.robot.robot import Robot
from schema.tables.files import born_as, read_table
from schema.wire.arena import Rebuild
from schema.wire.born import robot_of_birth
from schema.wire.recorded import last_recorded, repeatable

_TRACK = ("sim_time_s", "x", "y", "z", "qw", "qx", "qy", "qz", "angles")
_COMPARED = ("fitness", "path_velocity", "straight_velocity", "simulated_s")


Replayed = tuple[bool, pa.Table, pa.Table]
"""Whether an advance ends as recorded, poses at the recorded times, and motion."""


@dataclass(frozen=True, slots=True)
class Simulators:
    """Functions that simulate robots again.

    Attributes:
        alone: evaluates a robot; returns the evaluation and poses.
        history: reads the settings and the past of an arena before a time [s].
        together: replays an arena; yields its advances.
    """

    alone: Callable[[Robot, EvaluationSettings, Identity], tuple[Evaluation, pa.Table]]
    history: Callable[[Path, int, float], tuple[bytes, Rebuild]]
    together: Callable[[bytes, Rebuild, frozenset[BirthId]], Iterator[Replayed]]


def resimulate(
    run: LoadedRun,
    births: list[BirthId],
    simulators: Simulators,
    report: Callable[[float], None],
) -> list[Motion]:
    """Return the motions of robots, in their order; report the progress, 0 to 1.

    Raises:
        ViewerError: no evaluation or pose of a robot is recorded.
        RevolveError: the journal cannot be read, or a robot cannot be simulated.
    """
    experiment = experiment_from_text(run.document)
    moved: dict[BirthId, Motion] = {}
    for island in sorted({birth.island for birth in births}):
        if island_experiment(experiment, island).arena is not None:
            moved |= _in_arena(run.folder, island, births, simulators, report)
    for number, birth in enumerate(births, start=1):
        if birth not in moved:
            moved[birth] = _alone(run, experiment, birth, simulators)
            report(number / len(births))
    return [moved[birth] for birth in births]


def _alone(
    run: LoadedRun, experiment: Experiment, birth: BirthId, simulators: Simulators
) -> Motion:
    """Return the motion of a robot alone on its island, in its fittest evaluation."""
    table = _rows_of(run.folder, "evaluations", birth)
    rows = table.to_pylist()
    if not rows:
        raise ViewerError(f"robot {birth.name}: no evaluation is recorded")
    fitness = [-math.inf if row["fitness"] is None else row["fitness"] for row in rows]
    number = fitness.index(max(fitness))
    recorded = rows[number]
    learning = _rows_of(run.folder, "learning", birth)
    (fittest,) = last_recorded(table.slice(number, 1), learning).values()
    (born,) = _rows_of(run.folder, "births", birth).to_pylist()
    origin = Origin(seed=run.seed, run=run.number, island=birth.island)
    own = repeatable(experiment, origin, born, fittest)
    robot = robot_of_birth(born["genome"], born["robot"], own.document)
    evaluation, poses = simulators.alone(robot, own.settings, own.identity)
    differing = [
        f"{name} {recorded[name]}, now {getattr(evaluation, name)}"
        for name in _COMPARED
        if recorded[name] != getattr(evaluation, name)
    ]
    name = birth.name
    if len(rows) > 1:
        name += f", evaluation {number + 1} of {len(rows)}, the fittest"
    if own.settings.robust is None:
        return Motion(birth, poses, _verdict(name, differing, recorded["platform"]))
    # The evaluation combines several simulations; the poses are of another one.
    verdict = _verdict(name, differing, recorded["platform"], "evaluates")
    return Motion(birth, poses, f"{verdict}; shown without disturbances")


def _in_arena(
    folder: Path,
    island: int,
    births: list[BirthId],
    simulators: Simulators,
    report: Callable[[float], None],
) -> dict[BirthId, Motion]:
    here = [birth for birth in births if birth.island == island]
    recorded = {birth: _rows_of(folder, "poses", birth) for birth in here}
    for birth, rows in recorded.items():
        if not rows.num_rows:
            raise ViewerError(f"robot {birth.name}: no pose is recorded")
    span = pc.min_max(pa.concat_tables(recorded.values())["sim_time_s"]).as_py()
    settings, past = simulators.history(folder, island, span["min"])
    samples, motion = [], []
    is_equal = True
    steps = simulators.together(settings, past, frozenset(recorded))
    for number, (ends_equal, poses, moved) in enumerate(steps, start=1):
        report(number / len(past.history))
        is_equal = is_equal and ends_equal
        samples.append(poses)
        motion.append(moved)
        times = poses["sim_time_s"]
        if len(times) and pc.max(times).as_py() >= span["max"]:
            break
    replayed, frames = pa.concat_tables(samples), pa.concat_tables(motion)
    platform = next(iter(read_table(folder, "runs")["platform"].to_pylist()), "")
    motions = {}
    for birth, rows in recorded.items():
        again = replayed.filter(born_as(birth))
        differing = _differences(rows, again, is_equal=is_equal)
        verdict = _verdict(birth.name, differing, platform)
        motions[birth] = Motion(birth, frames.filter(born_as(birth)), verdict)
    return motions


def _differences(
    recorded: pa.Table, replayed: pa.Table, *, is_equal: bool
) -> list[str]:
    columns = [name for name in replayed.column_names if name in _TRACK]
    first = recorded.select(columns).combine_chunks()
    second = replayed.select(columns).combine_chunks()
    if not first.equals(second):
        return [f"{first.num_rows} poses recorded, {second.num_rows} now differ"]
    if is_equal:
        return []
    # Other versions may encode the state differently and move robots equally.
    return ["the arena's state, but no pose; other versions may encode it differently"]


def _rows_of(folder: Path, table: str, birth: BirthId) -> pa.Table:
    """Return the rows of a robot on the island where it was born."""
    rows = read_table(folder, table, where=born_as(birth))
    if "birth_island" in rows.column_names:
        rows = rows.filter(pc.is_null(rows["birth_island"]))
    return rows


def _verdict(
    name: str, differing: list[str], platform: str, verb: str = "moves"
) -> str:
    """Return a line of text that says whether a robot moves as recorded."""
    if not differing:
        return f"{name}: {verb} as recorded, equal to the last bit"
    here = platform_tag()
    where = f"same platform, {here}"
    if platform != here:
        where = f"recorded on {platform or 'an unknown platform'}, this is {here}"
    what = "; ".join(differing)
    return f"{name}: DIFFERS from the record: {what} ({where})"
