"""Doing again what robots did, to see all of it.

What comes out is what came out the first time, to the last bit, on an equal platform;
whoever asks compares. An arena that drifted has lived on several, and is done again as
nearly as it goes.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import mujoco
import numpy as np
import pyarrow as pa

from schema.experiment.identity import Identity
from schema.experiment.settings import EvaluationSettings, read_arena_settings
from schema.robot.ids import BirthId
from schema.robot.results import Evaluation
from schema.robot.robot import Robot
from schema.tables.columns import POSES, read_columns
from schema.wire.arena_codec import Rebuild
from worker.arena.births import possible
from worker.arena.world import World
from worker.robot.evaluation import evaluate, simulate


@dataclass(frozen=True, slots=True)
class Scene:
    """What an arena came to on the way to a step.

    Attributes:
        step: reached.
        is_equal: its state there has the digest that it had.
        samples: the poses that were recorded on the way, of all robots.
        motion: of the robots in question, at every tick of the brains.
    """

    step: int
    is_equal: bool
    samples: pa.Table
    motion: pa.Table


def alone(
    robot: Robot, settings: EvaluationSettings, identity: Identity
) -> tuple[Evaluation, pa.Table]:
    """Return a robot's evaluation, and its poses at every tick of its brain.

    Args:
        robot: a checked robot.
        settings: as for ``evaluate``.
        identity: which evaluation it is; the rows have its birth.

    Returns:
        The evaluation; rows of the poses table, without ``record``.

    Raises:
        RevolveError: as ``evaluate`` raises.
    """
    positions: list[np.ndarray[tuple[int], np.dtype[np.float64]]] = []
    times: list[float] = []

    def watch(data: mujoco.MjData) -> None:
        positions.append(data.qpos.copy())
        times.append(float(data.time))

    space, simulation, world = settings.space, settings.simulation, settings.environment
    simulate(robot, space, simulation, world, identity=identity, watch=watch)
    rows = _rows(identity.birth, times, np.array(positions))
    return evaluate(robot, settings, identity), rows


def together(
    settings: bytes, past: Rebuild, births: frozenset[BirthId], threads: int = 1
) -> Iterator[Scene]:
    """Return, advance by advance, what an arena came to.

    Args:
        settings: JSON of the arena's settings.
        past: a state, and the advances since.
        births: the robots in question.
        threads: that advance it together.

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
            is_seen = not births.isdisjoint(world.births)
            samples: list[pa.Table] = []
            motion: list[pa.Table] = []
            while world.step < advance.until:
                stop = world.step - world.step % tick + tick if is_seen else 1 << 62
                came = world.advance(min(stop, advance.until))
                samples.append(read_columns("poses", came.poses))
                if is_seen:
                    now = read_columns("poses", world.poses())
                    motion.append(_of(now, births))
            yield Scene(
                world.step,
                world.digest() == advance.digest,
                pa.concat_tables(samples),
                pa.concat_tables(motion) if motion else POSES.remove(0).empty_table(),
            )
    finally:
        world.close()


def _rows(
    birth: BirthId,
    times_s: list[float],
    positions: np.ndarray[tuple[int, int], np.dtype[np.float64]],
) -> pa.Table:
    """Return rows of the poses table, from times and (T, 7 + J) positions."""
    schema = POSES.remove(0)
    angles = positions[:, 7:].astype(np.float32)
    columns = {
        "island": np.full(len(times_s), birth.island, dtype=np.int32),
        "birth": np.full(len(times_s), birth.number, dtype=np.int64),
        "sim_time_s": np.array(times_s),
        "angles": pa.array(list(angles), schema.field("angles").type),
    }
    for index, axis in enumerate(("x", "y", "z", "qw", "qx", "qy", "qz")):
        columns[axis] = positions[:, index].astype(np.float32)
    missing = pa.nulls(len(times_s), pa.int32())
    arrays = [columns.get(name, missing) for name in schema.names]
    return pa.table(arrays, schema=schema)


def _of(poses: pa.Table, births: frozenset[BirthId]) -> pa.Table:
    """Return the rows of some robots."""
    names = zip(poses["island"].to_pylist(), poses["birth"].to_pylist(), strict=True)
    return poses.filter(pa.array([BirthId(*name) in births for name in names]))
