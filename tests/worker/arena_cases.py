"""Arenas for tests: settings, newborns, worlds and advances."""

import math
from collections.abc import Callable, Iterable, Sequence
from itertools import repeat
from typing import Any

import numpy as np
from msgspec.structs import replace

from schema.experiment.document import ArenaSection, Experiment
from schema.experiment.settings import ArenaSettings
from schema.robot.groups import Group
from schema.robot.ids import BirthId
from schema.robot.robot import Robot
from schema.wire.arena import Advance, Changes, Insertion
from worker.arena.world import World
from worker.clusters.population import ArenaPopulation

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


class Regroupings:
    """Numbers of merges and splits of a population's clusters from now on."""

    def __init__(self, population: ArenaPopulation) -> None:
        self.merges = self.splits = 0
        self._population, self._regroup = population, population.regroup
        population.regroup = self._count  # type: ignore[method-assign]

    def _count(self, groups: Iterable[Group]) -> None:
        population, groups = self._population, list(groups)
        present = {cluster.members for cluster in population.clusters}
        divided: list[Group] = []
        for members in groups:
            if members not in present:
                homes = {population.cluster_of[birth].members for birth in members}
                self.merges += len(homes) - 1
                divided += homes if len(homes) == 1 else ()
        self.splits += len(divided) - len(set(divided))
        self._regroup(groups)


def populated(
    settings: ArenaSettings, newborns: Sequence[Insertion], threads: int = 1
) -> World:
    """Return a world into which robots have just been inserted."""
    return counted(settings, newborns, threads)[0]


def counted(
    settings: ArenaSettings, newborns: Sequence[Insertion], threads: int = 1
) -> tuple[World, Regroupings]:
    """Return a world as ``populated`` does, and its merges and splits so far."""
    world = World(settings, threads)
    regrouped = Regroupings(world.population)
    world.apply(Changes(insertions=tuple(newborns)))
    return world, regrouped


def state_of(world: World, birth: BirthId) -> bytes:
    """Return a robot's physics, readings and network states as bytes."""
    one = world.population.find(birth)
    arrays = (one.view.qpos, one.view.qvel, one.view.ctrl, one.view.sensors.readings)
    return b"".join(np.asarray(a).tobytes() for a in (*arrays, one.states))


def seconds(world: World, count: float) -> Advance:
    """Advance by simulated seconds."""
    return world.advance(world.step + round(count * SECOND))
