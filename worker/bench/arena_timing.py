"""Timing of arenas.

Only this file and ``worker.bench.command`` read a clock; the timed code never does.
"""

import math
import time
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from schema.experiment.settings import ArenaSettings
from schema.robot.ids import BirthId
from schema.robot.results import Floats
from schema.robot.robot import Robot
from schema.wire.arena import Changes, Insertion
from worker.arena.world import World

Place = tuple[float, float]


@dataclass(frozen=True, slots=True)
class ArenaTiming:
    """Time that an arena took.

    Attributes:
        robots: number of robots at the start.
        simulated_s: simulated time [s].
        wall_s: wall time; CPU time of the thread if there is one thread [s].
    """

    robots: int
    simulated_s: float
    wall_s: float

    @property
    def factor(self) -> float:
        """Real-time factor: simulated over wall time."""
        return self.simulated_s / self.wall_s


def birth_places(
    rng: np.random.Generator, count: int, settings: ArenaSettings
) -> list[Place]:
    """Return random places as of on-line births, at a distance from earlier ones.

    Args:
        rng: to draw from.
        count: number of places.
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


def insertions(
    robots: Sequence[Robot], places: Sequence[Place], first: int = 0
) -> tuple[Insertion, ...]:
    """Return insertions of robots at places, numbered from ``first``."""
    return tuple(
        Insertion(BirthId(0, number), robot, place)
        for number, (robot, place) in enumerate(
            zip(robots, places, strict=True), start=first
        )
    )


def time_arena(
    settings: ArenaSettings,
    robots: Sequence[Insertion],
    *,
    seconds: int,
    threads: int = 1,
) -> ArenaTiming:
    """Return the time that an arena takes.

    Args:
        settings: of the arena.
        robots: inserted at the start; this is not timed.
        seconds: simulated time [s].
        threads: that step clusters.
    """
    clock = time.thread_time if threads == 1 else time.perf_counter
    second = round(1.0 / settings.simulation.timestep_s)
    world = World(settings, threads)
    world.apply(Changes(insertions=tuple(robots)))
    start = clock()
    for _ in range(seconds):
        world.advance(world.step + second)
    wall_s = clock() - start
    world.close()
    simulated_s = world.step * settings.simulation.timestep_s
    return ArenaTiming(len(robots), simulated_s, wall_s)


def quadratic_fit(sizes: Sequence[int], factors: Sequence[float]) -> Floats:
    """Return a, b, c of factor = a + b / p + c / p^2, by least squares.

    Source: the thesis's figure 6.1.
    """
    p = np.asarray(sizes, dtype=np.float64)
    terms = np.stack([np.ones_like(p), 1.0 / p, 1.0 / p**2], axis=1)
    return np.asarray(np.linalg.lstsq(terms, np.asarray(factors), rcond=None)[0])
