"""Timing of an arena compared with the physics of its clusters and robots alone."""

import math
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import TypeVar
from unittest.mock import patch

import mujoco
import numpy as np

from schema.experiment.settings import ArenaSettings
from schema.robot.trace import Floats
from schema.wire.arena import Changes, Insertion
from tests.worker.arena_cases import Regroupings
from worker.arena.threads import ThreadTeam
from worker.arena.world import World
from worker.bench.arena_timing import Place
from worker.clusters.cluster import Cluster

T = TypeVar("T")
Clock = Callable[[], float]


@dataclass(frozen=True, slots=True)
class ArenaTiming:
    """Components of the time of an arena.

    Attributes:
        simulated_s: simulated time [s].
        wall_s: wall time; CPU time of the thread if there is one thread [s].
        cluster_s: time of the steps of the very same clusters alone, with the same
            commands [s]; 0 if not measured.
        solo_s: time of the steps of the same robots, each in a model of its own, on as
            many threads [s]; 0 if not measured.
        changing_s: of ``wall_s``, births, deaths and regrouping [s].
        merging_s: of ``wall_s``, checks for merges [s].
        merges, splits: of clusters.
        largest: size of the largest cluster at the end.
    """

    simulated_s: float
    wall_s: float
    cluster_s: float
    solo_s: float
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
    def cluster_ratio(self) -> float:
        """Ratio of the time of its clusters' steps to the time of the arena."""
        return self.cluster_s / self.wall_s

    @property
    def solo_ratio(self) -> float:
        """Ratio of the time of the robots' steps in own models to that of the arena."""
        return self.solo_s / self.wall_s


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


@dataclass(slots=True)
class Run:
    """Steps of a cluster from one tick to the next, to be repeated alone.

    Attributes:
        model, data: of the cluster; the data is a copy.
        state: positions and velocities at the start; None if the cluster's last run
            ended there.
        ctrl: commands.
        plan: steps to each moment from the one before.
    """

    model: mujoco.MjModel
    data: mujoco.MjData
    state: tuple[Floats, Floats] | None
    ctrl: Floats
    plan: list[int]


class RecordedArena:
    """An arena equal to the timed one, which records the steps of its clusters.

    Attributes:
        world: the arena.
        copies: state of each cluster in which its steps are repeated.
    """

    def __init__(self, settings: ArenaSettings, robots: Sequence[Insertion]) -> None:
        """Insert the robots into an empty arena."""
        self.world = World(settings)
        self.world.apply(Changes(insertions=tuple(robots)))
        self._runs: list[Run] = []
        self.copies: dict[Cluster, mujoco.MjData] = {}
        self._ends: dict[Cluster, tuple[Floats, Floats]] = {}

    def advance(self, changes: Changes, until: int) -> None:
        """Apply changes, advance and record."""
        run_cluster, rewind_cluster = Cluster.run, Cluster.rewind
        latest: dict[Cluster, tuple[Run, int]] = {}

        def run(cluster: Cluster, plan: Sequence[int], first: int = 0) -> None:
            start, end = _state(cluster.data), self._ends.get(cluster)
            if cluster not in self.copies:
                self.copies[cluster] = mujoco.MjData(cluster.model)
            continues = end is not None and all(map(np.array_equal, start, end))
            self._runs.append(
                Run(
                    cluster.model,
                    self.copies[cluster],
                    None if continues else start,
                    cluster.data.ctrl.copy(),
                    list(plan[first:]),
                )
            )
            latest[cluster] = self._runs[-1], first
            run_cluster(cluster, plan, first)
            self._ends[cluster] = _state(cluster.data)

        def rewind(cluster: Cluster, moment: int) -> None:
            # Steps that are dropped do not count.
            if cluster in latest:
                recorded, first = latest[cluster]
                del recorded.plan[max(0, moment + 1 - first) :]
            rewind_cluster(cluster, moment)

        self.world.apply(changes)
        with patch.object(Cluster, "run", run), patch.object(Cluster, "rewind", rewind):
            self.world.advance(until)

    def replay(self, clock: Clock) -> float:
        """Return the time of the recorded steps alone [s], and forget them."""
        runs, self._runs = self._runs, []
        began = clock()
        for run in runs:
            if run.state is not None:
                run.data.qpos[:], run.data.qvel[:] = run.state
            run.data.ctrl[:] = run.ctrl
            mujoco.mj_step(run.model, run.data, sum(run.plan))
        return clock() - began


def _state(data: mujoco.MjData) -> tuple[Floats, Floats]:
    return data.qpos.copy(), data.qvel.copy()


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
    advance_s: int = 1,
    measures: str = "",
) -> ArenaTiming:
    """Return the components of the time of an arena.

    Args:
        settings: settings of the arena.
        robots: inserted at the start, which is not timed.
        seconds: simulated time that is timed, a multiple of ``advance_s`` [s].
        threads: number of threads that step clusters.
        spares: robots born one per advance, each replacing the oldest robot.
        warm_up_s: simulated time before the measurement [s].
        advance_s: length of an advance [s].
        measures: "solo" also times the steps of the same robots in own models, after
            each advance; "all" also those of the same clusters, by turns before and
            after it, with one thread.
    """
    clock = time.thread_time if threads == 1 else time.perf_counter
    second = round(1.0 / settings.simulation.timestep_s)
    steps = advance_s * second
    world, changing, merging = (
        World(settings, threads),
        Stopwatch(clock),
        Stopwatch(clock),
    )
    world.apply(Changes(insertions=tuple(robots)))
    world.advance(warm_up_s * second)
    recorded = RecordedArena(settings, robots) if measures == "all" else None
    if recorded is not None:
        recorded.world.advance(warm_up_s * second)
    population, wall, cluster, solo = world.population, 0.0, 0.0, 0.0
    regrouped = Regroupings(population)
    merging.wrap(population, "merge")
    changing.wrap(population, "regroup", "split", "remove", "catch_up")
    changing.wrap(world, "apply")
    unborn, pool = list(spares), ThreadTeam(threads)
    for number in range(seconds // advance_s):
        changes = Changes()
        if unborn and world.births:
            changes = Changes((world.births[0],), (unborn.pop(0),))
        if recorded is not None:
            recorded.advance(changes, world.step + steps)
            if number % 2:
                cluster += recorded.replay(clock)
        start = clock()
        world.apply(changes)
        world.advance(world.step + steps)
        wall += clock() - start
        if recorded is not None and not number % 2:
            cluster += recorded.replay(clock)
        if measures:
            solo += solo_time(world, pool, steps, clock)
    world.close()
    pool.close()
    assert recorded is None or recorded.world.digest() == world.digest()
    return ArenaTiming(
        simulated_s=seconds,
        wall_s=wall,
        cluster_s=cluster,
        solo_s=solo,
        changing_s=changing.total_s,
        merging_s=merging.total_s,
        merges=regrouped.merges,
        splits=regrouped.splits,
        largest=max((len(c.members) for c in population.clusters), default=0),
    )


def solo_time(world: World, pool: ThreadTeam, steps: int, clock: Clock) -> float:
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
