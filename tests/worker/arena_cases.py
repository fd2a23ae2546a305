"""Arenas for tests: settings, newborns, worlds and advances."""

import math
from collections.abc import Callable, Sequence
from itertools import repeat
from typing import Any

import numpy as np
from msgspec.structs import replace

from schema.experiment.document import ArenaSection, Experiment
from schema.experiment.settings import ArenaSettings
from schema.robot.ids import BirthId
from schema.robot.robot import Robot
from schema.wire.arena import Advance, Changes, Insertion
from worker.arena.world import World

EXPERIMENT = Experiment(name="test")
SECOND = 200
"""Physics steps of a simulated second."""
Robots = Callable[[int], Robot]


def settings_of(**arena: Any) -> ArenaSettings:  # noqa: ANN401 - any of its keys
    """Return the settings of scenario 3 with some keys of its arena changed."""
    return ArenaSettings(
        space=EXPERIMENT.space,
        simulation=replace(EXPERIMENT.simulation, warmup_steps=600),
        fitness=EXPERIMENT.fitness,
        arena=ArenaSection(**arena),
    )


SETTINGS = settings_of()


def crowd(
    robot_of: Robots, count: int, radius_m: float, *, seed: int = 1, first: int = 0
) -> tuple[Insertion, ...]:
    """Return newborns at random places and headings, at some distance."""
    rng = np.random.default_rng(seed)
    found: list[Insertion] = []
    places: list[tuple[float, float]] = []
    least = 0.3
    while len(found) < count:
        angle, share = rng.uniform(0.0, 2.0 * math.pi), rng.uniform()
        radius = radius_m * math.sqrt(share)
        place = (radius * math.cos(angle), radius * math.sin(angle))
        heading = float(rng.uniform(0.0, 2.0 * math.pi))
        least *= 0.999
        if all(math.dist(place, other) >= least for other in places):
            birth = BirthId(0, first + len(found))
            places.append(place)
            found.append(Insertion(birth, robot_of(birth.number), place, heading))
    return tuple(found)


def placed(robot: Robot, *places: tuple[float, float]) -> tuple[Insertion, ...]:
    """Return equal newborns with the first numbers of births."""
    births = (BirthId(0, number) for number in range(len(places)))
    return tuple(map(Insertion, births, repeat(robot), places))


def populated(
    settings: ArenaSettings, newborns: Sequence[Insertion], threads: int = 1
) -> World:
    """Return a world into which robots have just been inserted."""
    world = World(settings, threads)
    world.apply(Changes(insertions=tuple(newborns)))
    return world


def state_of(world: World, birth: BirthId) -> bytes:
    """Return a robot's physics, readings and network states as bytes."""
    one = world.population.find(birth)
    arrays = (one.view.qpos, one.view.qvel, one.view.ctrl, one.view.sensors.readings)
    return b"".join(np.asarray(a).tobytes() for a in (*arrays, one.states))


def seconds(world: World, count: float) -> Advance:
    """Advance by simulated seconds."""
    return world.advance(world.step + round(count * SECOND))
