"""Replay of evaluations and arenas, with the motion of chosen robots.

On an equal platform, results equal the original ones to the last bit; the caller
compares them. An arena that drifted has run on several platforms, and its replay is an
approximation.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import mujoco
import numpy as np
import pyarrow as pa

from schema.experiment.identity import Identity
from schema.experiment.scenery import object_count
from schema.experiment.settings import EvaluationSettings, read_arena_settings
from schema.robot.ids import BirthId
from schema.robot.results import Evaluation, Floats
from schema.robot.robot import Robot
from schema.tables.columns import ROWS
from schema.tables.received import read_columns
from schema.wire.arena_codec import Rebuild
from worker.arena.changes import possible
from worker.arena.records import pose_batch
from worker.arena.world import World
from worker.robot.evaluation import evaluate, simulate


@dataclass(frozen=True, slots=True)
class Scene:
    """One advance of a replayed arena.

    Attributes:
        step: reached.
        is_equal: whether the state there has the recorded digest.
        samples: poses of all robots that the advance records.
        motion: poses of the chosen robots at every tick of the controllers.
    """

    step: int
    is_equal: bool
    samples: pa.Table
    motion: pa.Table


def alone(
    robot: Robot, settings: EvaluationSettings, identity: Identity
) -> tuple[Evaluation, pa.Table]:
    """Return a robot's evaluation, and its poses at every tick of its controller.

    Args:
        robot: a checked robot.
        settings: as for ``evaluate``.
        identity: of the evaluation; the rows have its birth.

    Returns:
        The evaluation; rows of the poses table, without ``record``.

    Raises:
        RevolveError: as ``evaluate`` raises.
    """
    positions: list[Floats] = []
    times: list[float] = []

    def watch(data: mujoco.MjData) -> None:
        positions.append(data.qpos.copy())
        times.append(float(data.time))

    simulate(robot, settings, identity=identity, watch=watch)
    count, qpos = len(times), np.array(positions)
    objects = object_count(settings.environment, settings.simulation)
    joints = qpos.shape[1] - 7 * (1 + objects)
    rows = pose_batch(
        islands=np.full(count, identity.birth.island, dtype=np.int32),
        numbers=np.full(count, identity.birth.number, dtype=np.int64),
        times_s=np.array(times),
        roots=qpos[:, :7],
        joint_counts=np.full(count, joints, dtype=np.int32),
        angles=qpos[:, 7 : 7 + joints].ravel(),
    )
    return evaluate(robot, settings, identity), pa.Table.from_batches([rows])


def together(
    settings: bytes, past: Rebuild, births: frozenset[BirthId], threads: int = 1
) -> Iterator[Scene]:
    """Replay an arena, advance by advance.

    Args:
        settings: JSON of the arena's settings.
        past: a state, and the advances since.
        births: the robots whose motion to return.
        threads: that step clusters.

    Raises:
        MalformedMessage: a snapshot of other settings.
    """
    own = read_arena_settings(settings)
    world = (
        World.restore(own, past.snapshot, threads)
        if past.snapshot
        else World(own, threads)
    )
    tick = own.simulation.brain_steps
    try:
        for advance in past.history:
            world.apply(possible(advance.changes, world.births))
            is_shown = not births.isdisjoint(world.births)
            samples: list[pa.Table] = []
            motion: list[pa.Table] = []
            while world.step < advance.until:
                stop = advance.until
                if is_shown:
                    stop = min(stop, world.step - world.step % tick + tick)
                samples.append(read_columns("poses", world.advance(stop).poses))
                if is_shown:
                    now = read_columns("poses", world.poses())
                    motion.append(_rows_of(now, births))
            yield Scene(
                world.step,
                world.digest() == advance.digest,
                pa.concat_tables(samples),
                pa.concat_tables(motion) if motion else ROWS["poses"].empty_table(),
            )
    finally:
        world.close()


def _rows_of(poses: pa.Table, births: frozenset[BirthId]) -> pa.Table:
    """Return the rows of some robots."""
    names = zip(poses["island"].to_pylist(), poses["birth"].to_pylist(), strict=True)
    return poses.filter(pa.array([BirthId(*name) in births for name in names]))
