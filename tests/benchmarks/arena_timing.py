"""Timing of an arena compared with the bare physics of its robots, by second."""

import math
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import TypeVar

import mujoco
import numpy as np

from schema.experiment.settings import ArenaSettings
from schema.wire.arena import Changes, Insertion
from worker.arena.threads import Pool
from worker.arena.world import World
from worker.bench.arena_timing import Place

T = TypeVar("T")
Clock = Callable[[], float]


@dataclass(frozen=True, slots=True)
class ArenaTiming:
    """Components of the time of an arena.

    Attributes:
        simulated_s: simulated time [s].
        wall_s: wall time; CPU time of the thread if there is one thread [s].
        bare_s: time of the same robots' steps alone on as many threads [s]; 0 if not
            measured.
        changing_s: of ``wall_s``, births, deaths and regrouping [s].
        merging_s: of ``wall_s``, checks for merges [s].
        merges, splits: of clusters.
        largest: size of the largest cluster at the end.
    """

    simulated_s: float
    wall_s: float
    bare_s: float
    changing_s: float
    merging_s: float
    merges: int
    splits: int
    largest: int

    @property
    def factor(self) -> float:
        """Real-time factor: simulated over wall time."""
        return self.simulated_s / self.wall_s

    @property
    def ratio(self) -> float:
        """Ratio of the time of the robots' bare steps to the time of the arena."""
        return self.bare_s / self.wall_s


class Stopwatch:
    """Total time of some of an object's methods."""

    def __init__(self, clock: Clock) -> None:
        self._clock = clock
        self._depth = 0
        self.total_s = 0.0

    def wrap(self, owner: object, *names: str) -> None:
        """Measure further calls of methods of an object; nested calls count once."""
        for name in names:
            setattr(owner, name, self._timed(getattr(owner, name)))

    def _timed(self, function: Callable[..., T]) -> Callable[..., T]:
        def run(*arguments: object, **named: object) -> T:
            self._depth += 1
            began = self._clock()
            try:
                return function(*arguments, **named)
            finally:
                self._depth -= 1
                if not self._depth:
                    self.total_s += self._clock() - began

        return run


def even_places(rng: np.random.Generator, count: int, radius_m: float) -> list[Place]:
    """Return random places on a disc, at least 0.25 m apart if possible."""
    places: list[Place] = []
    while len(places) < count:
        for _ in range(100):
            angle, share = rng.uniform(0.0, 2.0 * math.pi), rng.uniform()
            radius = radius_m * math.sqrt(share)
            place = (radius * math.cos(angle), radius * math.sin(angle))
            if all(math.dist(place, other) >= 0.25 for other in places):
                break
        places.append(place)
    return places


def time_arena(
    settings: ArenaSettings,
    robots: Sequence[Insertion],
    *,
    seconds: int,
    threads: int,
    spares: Sequence[Insertion],
    warm_up_s: int,
    measures_bare: bool,
) -> ArenaTiming:
    """Return the components of the time of an arena.

    Args:
        settings: settings of the arena.
        robots: inserted at the start, which is not timed.
        seconds: simulated time that is timed [s].
        threads: number of threads that step clusters.
        spares: robots born one per second, each replacing the oldest robot.
        warm_up_s: simulated time before the measurement [s].
        measures_bare: also time the bare steps of the same robots in each second.
    """
    clock = time.thread_time if threads == 1 else time.perf_counter
    second = round(1.0 / settings.simulation.timestep_s)
    world, changing, merging = (
        World(settings, threads),
        Stopwatch(clock),
        Stopwatch(clock),
    )
    world.apply(Changes(insertions=tuple(robots)))
    world.advance(warm_up_s * second)
    population, wall, bare = world.population, 0.0, 0.0
    merging.wrap(population, "merge")
    changing.wrap(population, "regroup", "split", "remove", "catch_up")
    changing.wrap(world, "apply")
    merges, splits = population.merges, population.splits
    unborn, pool = list(spares), Pool(threads)
    for _ in range(seconds):
        changes = Changes()
        if unborn and world.births:
            changes = Changes((world.births[0],), (unborn.pop(0),))
        start = clock()
        world.apply(changes)
        world.advance(world.step + second)
        wall += clock() - start
        if measures_bare:
            bare += bare_time(world, pool, second, clock)
    world.close()
    pool.close()
    return ArenaTiming(
        simulated_s=seconds,
        wall_s=wall,
        bare_s=bare,
        changing_s=changing.total_s,
        merging_s=merging.total_s,
        merges=population.merges - merges,
        splits=population.splits - splits,
        largest=max((len(c.members) for c in population.clusters), default=0),
    )


def bare_time(world: World, pool: Pool, steps: int, clock: Clock) -> float:
    """Return the time of the steps of a world's robots, each simulated alone.

    Control signals are constant. The world does not change.

    Args:
        world: world of the robots.
        pool: thread pool.
        steps: number of steps of each robot.
        clock: function that returns the time [s].
    """
    tick = world.population.model_cache.settings.simulation.brain_steps
    jobs = []
    for robot in world.population.robots:
        model = robot.body.solo.model
        data = mujoco.MjData(model)
        data.qpos[:], data.qvel[:] = robot.view.qpos, robot.view.qvel
        data.ctrl[:] = robot.view.ctrl
        jobs.append(partial(_step, model, data, steps, tick))
    began = clock()
    pool.run(jobs)
    return clock() - began


def _step(model: mujoco.MjModel, data: mujoco.MjData, steps: int, tick: int) -> None:
    for done in range(0, steps, tick):
        mujoco.mj_step(model, data, nstep=min(tick, steps - done))
