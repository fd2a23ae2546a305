"""How long arenas take, beside their robots' bare physics in the same minutes.

Only this and ``worker.bench.command`` look at a clock; what they time never does.
"""

import math
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import TypeVar

import mujoco
import numpy as np

from schema.experiment.settings import ArenaSettings
from schema.robot.ids import BirthId
from schema.robot.results import Floats
from schema.robot.robot import Robot
from schema.wire.arena import Changes, Insertion
from worker.arena.threads import Pool
from worker.arena.world import World

T = TypeVar("T")
Clock = Callable[[], float]
Place = tuple[float, float]


@dataclass(frozen=True, slots=True)
class ArenaTiming:
    """What an arena's time went to.

    Attributes:
        robots: that lived in it.
        simulated_s: how long [s].
        wall_s: it took [s].
        bare_s: the same robots' steps alone on as many threads, with nothing else
            [s]; 0 if not measured.
        coming_s: of ``wall_s``, births, deaths and regrouping [s].
        looking_s: of ``wall_s``, finding out who may touch whom [s].
        merges, splits: how often clusters were joined and parted.
        largest: cluster at the end.
    """

    robots: int
    simulated_s: float
    wall_s: float
    bare_s: float
    coming_s: float
    looking_s: float
    merges: int
    splits: int
    largest: int

    @property
    def factor(self) -> float:
        """Simulated per wall second: the real-time factor."""
        return self.simulated_s / self.wall_s

    @property
    def ratio(self) -> float:
        """Share of the time that the robots' bare steps would need."""
        return self.bare_s / self.wall_s


class Stopwatch:
    """Adds up the time that some of an object's methods take."""

    def __init__(self, clock: Clock) -> None:
        """Start at zero."""
        self._clock = clock
        self._depth = 0
        self.total_s = 0.0

    def wrap(self, owner: object, *names: str) -> None:
        """Time methods of an object from now on; nested ones count once."""
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


def birth_places(
    rng: np.random.Generator, count: int, settings: ArenaSettings
) -> list[Place]:
    """Return places as on-line births draw them, each apart from those before.

    Args:
        rng: to draw from.
        count: how many.
        settings: radius, least distance and tries.
    """
    arena = settings.arena
    places: list[Place] = []
    for _ in range(count):
        for _ in range(arena.birth_place_tries):
            angle, radius = rng.uniform(0.0, 2.0 * math.pi), rng.uniform()
            radius *= arena.birth_radius_m
            place = (radius * math.cos(angle), radius * math.sin(angle))
            if all(math.dist(place, p) >= arena.birth_distance_m for p in places):
                break
        places.append(place)
    return places


def even_places(rng: np.random.Generator, count: int, radius_m: float) -> list[Place]:
    """Return places spread evenly over a disc, none nearer than 0.25 m if possible."""
    places: list[Place] = []
    while len(places) < count:
        for _ in range(100):
            angle, share = rng.uniform(0.0, 2.0 * math.pi), rng.uniform()
            reach = radius_m * math.sqrt(share)
            place = (reach * math.cos(angle), reach * math.sin(angle))
            if all(math.dist(place, other) >= 0.25 for other in places):  # noqa: PLR2004
                break
        places.append(place)
    return places


def insertions(
    robots: Sequence[Robot], places: Sequence[Place], first: int = 0
) -> tuple[Insertion, ...]:
    """Return robots at their places, numbered from ``first``."""
    return tuple(
        Insertion(BirthId(0, number), robot, place)
        for number, (robot, place) in enumerate(
            zip(robots, places, strict=True), start=first
        )
    )


def time_arena(
    settings: ArenaSettings,
    newcomers: Sequence[Insertion],
    *,
    seconds: int,
    threads: int = 1,
    spares: Sequence[Insertion] = (),
    warm_s: int = 0,
    is_bare_wanted: bool = False,
) -> ArenaTiming:
    """Return how long an arena takes.

    Args:
        settings: its settings.
        newcomers: born at the beginning, before the clock runs.
        seconds: simulated and timed [s].
        threads: that step clusters.
        spares: each second one of them is born and the oldest robot dies.
        warm_s: simulated before the clock runs [s].
        is_bare_wanted: time also the same robots' bare steps, second by second.
    """
    clock = time.thread_time if threads == 1 else time.perf_counter
    second = round(1.0 / settings.simulation.timestep_s)
    world, coming, looking = (
        World(settings, threads),
        Stopwatch(clock),
        Stopwatch(clock),
    )
    world.apply(Changes(insertions=tuple(newcomers)))
    if warm_s:
        world.advance(warm_s * second)
    looking.wrap(world.population, "merge")
    coming.wrap(world.population, "regroup", "split", "remove", "catch_up")
    coming.wrap(world, "apply")
    population, wall, bare, steps = world.population, 0.0, 0.0, 0
    merges, splits = population.merges, population.splits
    waiting, pool = list(spares), Pool(threads)
    while steps < seconds * second:
        stop = min(second, seconds * second - steps)
        changes = Changes()
        if waiting and world.births:
            changes = Changes((world.births[0],), (waiting.pop(0),))
        began = clock()
        world.apply(changes)
        world.advance(world.step + stop)
        wall += clock() - began
        steps += stop
        if is_bare_wanted:
            bare += bare_time(world, pool, stop, clock)
    world.close()
    pool.close()
    return ArenaTiming(
        robots=len(newcomers),
        simulated_s=steps * settings.simulation.timestep_s,
        wall_s=wall,
        bare_s=bare,
        coming_s=coming.total_s,
        looking_s=looking.total_s,
        merges=population.merges - merges,
        splits=population.splits - splits,
        largest=max((len(c.members) for c in population.clusters), default=0),
    )


def bare_time(world: World, pool: Pool, steps: int, clock: Clock) -> float:
    """Return the time of a world's robots' steps, each alone, with nothing else.

    Their present commands are held; the world is left as it is.

    Args:
        world: whose robots.
        pool: the threads that share them out.
        steps: of each.
        clock: to read [s].
    """
    tick = world.population.model_cache.settings.simulation.brain_steps
    jobs = []
    for one in world.population.robots:
        model = one.body.home.model
        data = mujoco.MjData(model)
        data.qpos[:], data.qvel[:] = one.view.qpos, one.view.qvel
        data.ctrl[:] = one.view.ctrl
        jobs.append(partial(_step, model, data, steps, tick))
    began = clock()
    pool.run(jobs)
    return clock() - began


def _step(model: mujoco.MjModel, data: mujoco.MjData, steps: int, tick: int) -> None:
    for done in range(0, steps, tick):
        mujoco.mj_step(model, data, nstep=min(tick, steps - done))


def quadratic_fit(sizes: Sequence[int], factors: Sequence[float]) -> Floats:
    """Return a, b, c of factor = a + b / p + c / p^2, by least squares.

    Source: the thesis's figure 6.1.
    """
    p = np.asarray(sizes, dtype=np.float64)
    terms = np.stack([np.ones_like(p), 1.0 / p, 1.0 / p**2], axis=1)
    return np.asarray(np.linalg.lstsq(terms, np.asarray(factors), rcond=None)[0])
