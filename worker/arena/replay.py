"""Replay of evaluations and arenas, with the motion of chosen robots.

On an equal platform, results equal the original ones to the last bit; the caller
compares them. An arena that drifted has run on several platforms, and its replay is an
approximation.
"""

from collections.abc import Iterator

import mujoco
import numpy as np
import pyarrow as pa

from schema.experiment.identity import Identity
from schema.experiment.scenery import object_count
from schema.experiment.settings import EvaluationSettings, read_arena_settings
from schema.robot.ids import BirthId
from schema.robot.results import Evaluation
from schema.robot.robot import Robot
from schema.robot.trace import Floats
from schema.tables.columns import ROWS
from schema.wire.arena import Rebuild
from schema.wire.poses import PoseArrays
from worker.arena.changes import possible
from worker.arena.world import World
from worker.clusters.states import Schedule
from worker.robot.evaluation import evaluate, simulate


def alone(
    robot: Robot, settings: EvaluationSettings, identity: Identity
) -> tuple[Evaluation, pa.Table]:
    """Return a robot's evaluation, and its poses at every tick of its controller.

    The poses are rows of their table, without ``record``.
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
    poses = PoseArrays(
        islands=np.full(count, identity.birth.island, dtype=np.int32),
        births=np.full(count, identity.birth.number, dtype=np.int64),
        times_s=np.array(times),
        cores=qpos[:, :7].astype(np.float32),
        joints=np.full(count, joints, dtype=np.int32),
        angles=qpos[:, 7 : 7 + joints].ravel().astype(np.float32),
    )
    return evaluate(robot, settings, identity), poses.rows()


def together(
    settings: bytes, past: Rebuild, births: frozenset[BirthId]
) -> Iterator[tuple[bool, pa.Table, pa.Table]]:
    """Replay an arena, whose settings are JSON, from a state advance by advance.

    Yields whether the state after an advance has the recorded digest, the poses of all
    robots that the advance records, and those of some births at every tick.

    Raises:
        MalformedMessage: a snapshot of other settings.
    """
    own = read_arena_settings(settings)
    world = World.restore(own, past.snapshot) if past.snapshot else World(own)
    tick, next_tick = own.simulation.brain_steps, Schedule(own).next_tick
    try:
        for advance in past.history:
            world.apply(possible(advance.changes, world.births))
            is_shown = not births.isdisjoint(world.births)
            motion = [ROWS["poses"].empty_table()]
            if is_shown:
                # Judging removes robots without a fitness, so only the end is judged.
                for stop in range(next_tick(world.step), advance.until, tick):
                    world.step_to(stop)
                    motion.append(_motion(world, births))
            poses = world.advance(advance.until).poses
            samples = PoseArrays.received(poses).rows()
            if is_shown:
                motion.append(_motion(world, births))
            is_equal = world.digest() == advance.digest
            yield is_equal, samples, pa.concat_tables(motion)
    finally:
        world.close()


def _motion(world: World, births: frozenset[BirthId]) -> pa.Table:
    poses = world.poses()
    is_chosen = [robot in births for robot in poses.robots]
    return poses.rows().filter(pa.array(is_chosen, pa.bool_()))
