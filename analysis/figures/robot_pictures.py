"""Pictures of the best robots and their families."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
import pyarrow as pa
from msgspec.structs import replace

from analysis.figures.family_tree import Best, Family, family, lineage, row_of
from analysis.render.picture import Picture, Simulate, Studio
from schema.errors import RunFolderError
from schema.experiment.document import Experiment, body_space, island_experiment
from schema.experiment.identity import Identity, Origin
from schema.robot.genome import develop
from schema.robot.ids import BirthId
from schema.robot.results import Floats
from schema.robot.robot import Robot
from schema.wire.codec import decode_genome

FRAMES = 6
EVERY_S = 0.5
"""Pictures of a gait, and from one to the next [s]."""
_LARGE, _SMALL = (400, 300), (300, 225)
_WIDE, _CLOSE = (0.15, 0.15, 0.0), (0.26, 0.14, 0.1)
"""What is cut off: of the height above and below, of the width at each side.

Robots are flat, and what is near stands below the middle.
"""
NOBODYS = (0.93, 0.93, 0.93)
"""Colour of parts that came by mutation."""

Colour = tuple[float, float, float]


@dataclass(frozen=True, slots=True)
class RobotPicture:
    """What pictures show of an experiment's best robot.

    Attributes:
        best: which.
        gait: consecutive pictures, as it moves alone.
        times_s: when they were taken [s].
        family: its nearest ancestors; None if they are not wanted.
        pictures: of everybody in the family, by births row.
        births: name of each of those.
        lineage: itself and all its ancestors, as ``family_tree.LINEAGE``.
    """

    best: Best
    gait: tuple[Picture, ...]
    times_s: tuple[float, ...]
    family: Family | None
    pictures: Mapping[int, Picture]
    births: Mapping[int, BirthId]
    lineage: pa.Table


def robot_picture(
    best: Best,
    births: pa.Table,
    experiment: Experiment,
    simulate: Simulate,
    colours: tuple[Colour, ...],
    *,
    origin: Origin,
    has_family: bool,
) -> RobotPicture:
    """Return pictures of a robot, of how it moves, and of its family.

    Args:
        best: the robot.
        births: of its run; its birth is among them.
        experiment: of the run.
        simulate: the worker's.
        colours: of founders, those with the most parts first; the last is of all
            others.
        origin: the run, as what noise was drawn by.
        has_family: whether its family is pictured, too.

    Raises:
        RunFolderError: its birth is not recorded.
        NoPictures: nothing here can draw.
        SimulationDiverged: the physics did.
    """
    row = row_of(best, births)
    if row < 0:
        raise RunFolderError(f"{best.folder}: birth {best.birth} is not recorded")
    settings = island_experiment(experiment, best.birth_island)
    relatives = family(births, row)
    paint = dict(zip(relatives.founders, colours, strict=False))

    def colour(gene: int) -> Colour:
        founder = relatives.paint.get(gene)
        return NOBODYS if founder is None else paint.get(founder, colours[-1])

    def painted(who: int) -> Robot:
        genome = decode_genome(births["genome"][who].as_py())
        robot = develop(genome, body_space(settings.space))
        parts = tuple(
            replace(part, parameters=(*part.parameters[:-3], *colour(part.gene)))
            for part in robot.parts
        )
        return Robot(parts, robot.brain)

    people = [
        *relatives.founders,
        *(one for level in relatives.levels for one in level),
    ]
    pictures = {}
    for who in sorted(set(people)) if has_family else ():
        with _studio(painted(who), settings, _SMALL) as studio:
            pictures[who] = _cut(studio.picture(), _CLOSE)
    island = best.birth_island
    own = Identity(replace(origin, island=island), BirthId(island, best.birth), 0)
    gait, times = _gait(painted(row), settings, partial(simulate, identity=own))
    return RobotPicture(
        best,
        gait,
        times,
        relatives if has_family else None,
        pictures,
        {
            who: BirthId(births["island"][who].as_py(), births["birth"][who].as_py())
            for who in pictures
        },
        lineage(births, best.experiment, row),
    )


def _studio(robot: Robot, settings: Experiment, size: tuple[int, int]) -> Studio:
    space = body_space(settings.space)
    return Studio(robot, space, settings.simulation, settings.environment, size=size)


def _cut(picture: Picture, share: tuple[float, float, float]) -> Picture:
    high, wide = picture.shape[:2]
    top, below = round(share[0] * high), round(share[1] * high)
    left = round(share[2] * wide)
    return picture[top : high - below, left : wide - left]


def _gait(
    robot: Robot, settings: Experiment, simulate: Simulate
) -> tuple[tuple[Picture, ...], tuple[float, ...]]:
    """Return how a robot moves from the middle of its life on, by a standing camera."""
    poses: list[Floats] = []
    watch: Callable[[Any], None] = lambda data: poses.append(data.qpos.copy())  # noqa: E731
    world = settings.environment
    simulate(robot, settings.space, settings.simulation, world, watch=watch)
    tick_s = settings.simulation.brain_steps * settings.simulation.timestep_s
    step = max(1, round(EVERY_S / tick_s))
    first = len(poses) // 2
    chosen = range(first, len(poses), step)[:FRAMES]
    middle = np.mean([poses[at][:3] for at in chosen], axis=0)
    with _studio(robot, settings, _LARGE) as studio:
        pictures = tuple(
            _cut(studio.picture(poses[at], look_at=middle), _WIDE) for at in chosen
        )
    return pictures, tuple((at - first) * tick_s for at in chosen)
