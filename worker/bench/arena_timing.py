"""Timing of arenas.

Only this file and ``worker.bench.command`` read a clock; the timed code never does.
"""

import math
import time
from collections.abc import Sequence

import numpy as np

from schema.experiment.settings import ArenaSettings
from schema.robot.ids import BirthId
from schema.robot.robot import Robot
from schema.robot.trace import Floats
from schema.wire.arena import Changes, Insertion
from worker.arena.world import World

Place = tuple[float, float]


def birth_places(
    rng: np.random.Generator, count: int, settings: ArenaSettings
) -> list[Place]:
    """Return random places as of on-line births, at a distance from earlier ones."""
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
    robots: Sequence[Robot], places: Sequence[Place]
) -> tuple[Insertion, ...]:
    """Return insertions of robots at places, numbered from 0."""
    pairs = enumerate(zip(robots, places, strict=True))
    return tuple(Insertion(BirthId(0, number), *pair) for number, pair in pairs)


def time_arena(
    settings: ArenaSettings, robots: Sequence[Insertion], *, seconds: int, threads: int
) -> tuple[float, float]:
    """Return the simulated time of an arena and the time that it takes [s].

    That is wall time, or CPU time of the thread if there is one thread.
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
    return world.step * settings.simulation.timestep_s, wall_s


def quadratic_fit(sizes: Sequence[int], factors: Sequence[float]) -> Floats:
    """Return a, b, c of factor = a + b / p + c / p^2 (thesis, figure 6.1), fitted."""
    return np.asarray(
        np.polynomial.polynomial.polyfit(1.0 / np.array(sizes), factors, 2)
    )
