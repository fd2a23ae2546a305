"""Full motion of chosen robots, by simulating them again and comparing.

Whoever simulates is handed in: rooms do not know each other.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

import pyarrow as pa
import pyarrow.compute as pc
from msgspec.structs import replace

from analysis.viewer.motion import Motion, name_of
from analysis.viewer.recording import ViewerError
from analysis.viewer.replay import read_origin
from schema.agent.platform_tag import platform_tag
from schema.experiment.document import Experiment, body_space, island_experiment
from schema.experiment.identity import Identity
from schema.experiment.settings import (
    EvaluationSettings,
    evaluation_settings,
    lasting,
    read_evaluation_settings,
)
from schema.robot.genome import develop
from schema.robot.ids import BirthId
from schema.robot.results import Evaluation
from schema.robot.robot import Robot
from schema.tables.files import read_table
from schema.wire.arena_codec import Rebuild
from schema.wire.codec import decode_genome

_TRACK = ("sim_time_s", "x", "y", "z", "qw", "qx", "qy", "qz", "angles")
_COMPARED = ("fitness", "path_velocity", "straight_velocity", "simulated_s")


class ReplayedStep(Protocol):
    """A step of an arena that is done again; see ``worker.arena.replay``."""

    @property
    def step(self) -> int:
        """Reached."""

    @property
    def is_equal(self) -> bool:
        """Its state is what it was."""

    @property
    def samples(self) -> pa.Table:
        """The poses that were recorded."""

    @property
    def motion(self) -> pa.Table:
        """Poses of those in question, at every tick."""


@dataclass(frozen=True, slots=True)
class Simulators:
    """What does it again.

    Attributes:
        alone: a robot, its settings and which evaluation it is to that evaluation
            and poses.
        history: run folder, island and time to settings and past of its arena.
        together: settings, past and robots to scenes.
    """

    alone: Callable[[Robot, EvaluationSettings, Identity], tuple[Evaluation, pa.Table]]
    history: Callable[[Path, int, float], tuple[bytes, Rebuild]]
    together: Callable[[bytes, Rebuild, frozenset[BirthId]], Iterator[ReplayedStep]]


def resimulate(
    folder: Path,
    experiment: Experiment,
    births: list[BirthId],
    simulators: Simulators,
    report: Callable[[float], None],
) -> list[Motion]:
    """Return how robots moved.

    Args:
        folder: of the run.
        experiment: the run's.
        births: who.
        simulators: do it.
        report: is told how far it is, 0 to 1.

    Raises:
        ViewerError: nothing is recorded of a robot.
        RevolveError: the journal cannot be read, or a robot cannot be simulated.
    """
    arenas = [
        birth
        for birth in births
        if island_experiment(experiment, birth.island).arena is not None
    ]
    moved = {each.birth: each for each in _together(folder, arenas, simulators, report)}
    for number, birth in enumerate(births, start=1):
        if birth not in moved:
            moved[birth] = _alone(folder, experiment, birth, simulators)
            report(number / len(births))
    return [moved[birth] for birth in births]


def _alone(
    folder: Path, experiment: Experiment, birth: BirthId, simulators: Simulators
) -> Motion:
    """Return the motion of a robot that was judged alone."""
    own = island_experiment(experiment, birth.island)
    settings = read_evaluation_settings(evaluation_settings(own))
    rows = _rows_of(folder, "evaluations", birth).to_pylist()
    if not rows:
        raise ViewerError(f"robot {name_of(birth)}: no evaluation of it is recorded")
    recorded = rows[0]
    if recorded["simulated_s"] is not None:
        steps = round(recorded["simulated_s"] / settings.simulation.timestep_s)
        settings = lasting(settings, steps)
    genome = _rows_of(folder, "births", birth)["genome"][0].as_py()
    robot = develop(decode_genome(genome), body_space(own.space))
    origin = replace(read_origin(folder), island=birth.island)
    identity = Identity(origin, birth, recorded["trial"])
    evaluation, poses = simulators.alone(robot, settings, identity)
    differing = [
        f"{name} {recorded[name]}, now {getattr(evaluation, name)}"
        for name in _COMPARED
        if recorded[name] != getattr(evaluation, name)
    ]
    return Motion(birth, poses, _verdict(birth, differing, recorded["platform"]))


def _together(
    folder: Path,
    births: list[BirthId],
    simulators: Simulators,
    report: Callable[[float], None],
) -> list[Motion]:
    """Return the motion of robots in the arenas that they were born in."""
    motions: list[Motion] = []
    for island in sorted({birth.island for birth in births}):
        recorded = {
            birth: _rows_of(folder, "poses", birth)
            for birth in births
            if birth.island == island
        }
        for birth, rows in recorded.items():
            if not rows.num_rows:
                raise ViewerError(f"robot {name_of(birth)}: no pose of it is recorded")
        motions += _in_arena(folder, island, recorded, simulators, report)
    return motions


def _in_arena(
    folder: Path,
    island: int,
    recorded: dict[BirthId, pa.Table],
    simulators: Simulators,
    report: Callable[[float], None],
) -> list[Motion]:
    spans = [pc.min_max(rows["sim_time_s"]).as_py() for rows in recorded.values()]
    start_s = min(span["min"] for span in spans)
    end_s = max(span["max"] for span in spans)
    settings, past = simulators.history(folder, island, start_s)
    samples, motion = [], []
    is_equal = True
    scenes = simulators.together(settings, past, frozenset(recorded))
    for number, scene in enumerate(scenes, start=1):
        report(number / len(past.history))
        is_equal = is_equal and scene.is_equal
        samples.append(scene.samples)
        motion.append(scene.motion)
        times = scene.samples["sim_time_s"]
        if len(times) and pc.max(times).as_py() >= end_s:
            break
    again, frames = pa.concat_tables(samples), pa.concat_tables(motion)
    platforms = read_table(folder, "runs")["platform"].to_pylist()
    return [
        Motion(
            birth,
            _only(frames, birth),
            _verdict(
                birth,
                _differences(rows, _only(again, birth), is_equal=is_equal),
                platforms[0] if platforms else "",
            ),
        )
        for birth, rows in recorded.items()
    ]


def _differences(recorded: pa.Table, again: pa.Table, *, is_equal: bool) -> list[str]:
    """Return where a track is not what was recorded."""
    columns = [name for name in again.column_names if name in _TRACK]
    first = recorded.select(columns).combine_chunks()
    second = again.select(columns).combine_chunks()
    if not first.equals(second):
        return [f"{first.num_rows} poses recorded, {second.num_rows} now differ"]
    if is_equal:
        return []
    # Versions may note an arena's state otherwise and yet move it alike.
    return ["no pose, but the arena's state, which other versions write otherwise"]


def _rows_of(folder: Path, table: str, birth: BirthId) -> pa.Table:
    """Return the rows of a robot on the island where it was born."""
    rows = read_table(folder, table)
    is_it = pc.and_(
        pc.equal(rows["island"], birth.island), pc.equal(rows["birth"], birth.number)
    )
    if "birth_island" in rows.column_names:
        is_it = pc.and_(is_it, pc.is_null(rows["birth_island"]))
    return rows.filter(is_it)


def _only(poses: pa.Table, birth: BirthId) -> pa.Table:
    """Return a robot's rows of poses as a worker tells of them."""
    is_it = pc.and_(
        pc.equal(poses["island"], birth.island), pc.equal(poses["birth"], birth.number)
    )
    return poses.filter(is_it)


def _verdict(birth: BirthId, differing: list[str], platform: str) -> str:
    """Return whether a robot does again what it did."""
    if not differing:
        return f"{name_of(birth)}: moves again as recorded, to the last bit"
    here = platform_tag()
    where = (
        "on this very platform"
        if platform == here
        else f"recorded on {platform or 'an unknown platform'}, this is {here}"
    )
    what = "; ".join(differing)
    return f"{name_of(birth)}: DIFFERS from what was recorded: {what} ({where})"
