"""Renders the best robots, their gaits and their families."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import chain
from typing import Any

import numpy as np
import pyarrow as pa
from msgspec.structs import replace

from analysis.figures.family_tree import Best
from analysis.measures.families import Family
from analysis.measures.load import LoadedRun
from analysis.page.robots import page_of
from analysis.render.motion import recorded
from analysis.render.picture import RobotRenderer, Simulate
from analysis.render.stage import Picture
from schema.experiment.document import Experiment, island_experiment
from schema.experiment.file import experiment_from_text
from schema.experiment.identity import Identity, Origin
from schema.experiment.settings import EvaluationSettings, evaluation_settings_of
from schema.plugins.source import modules_named
from schema.robot.ids import BirthId
from schema.robot.robot import Robot
from schema.robot.trace import Floats
from schema.tables.description import allow_plugins_of
from schema.wire.born import birth_point, robot_of_birth

FRAMES = 6
EVERY_S = 0.5
"""Pictures of a gait, and the time between two of them [s]."""
FILM_EVERY_S = 0.05
"""Time between two pictures of a film [s]; it lasts as long as the gait."""
_LARGE, _SMALL, _FILMED = (400, 210), (300, 168), (400, 240)
"""Sizes of pictures of a gait, of families and of films [pixels]."""
_JUDGING = frozenset({"fitness", "measures", "selection"})
_SLOW_M = 0.1
"""Way during a gait below which its pictures are taken further apart [m]: a robot that
moves less looks the same in all of them."""
MUTATED = (0.93, 0.93, 0.93)
"""Colour of parts that were added by mutation."""

Colour = tuple[float, float, float]

FOUNDERS: tuple[Colour, ...] = (
    (0.00, 0.45, 0.70), (0.90, 0.62, 0.00), (0.00, 0.62, 0.45), (0.80, 0.47, 0.65),
    (0.84, 0.37, 0.00), (0.34, 0.71, 0.91), (0.94, 0.89, 0.26), (0.45, 0.45, 0.45),
)  # fmt: skip
"""Colours of founders, those with the most parts first; all others share the last.

Source: Okabe and Ito, 2008.
"""


@dataclass(frozen=True, slots=True)
class RobotPicture:
    """Pictures of an experiment's best robot.

    Attributes:
        best: the robot.
        gait: consecutive pictures of the robot moving alone.
        times_s: time of each of these pictures [s].
        film: pictures of the same time, more of them.
        moved_m: distance between the core's places in the first and last picture of
            the gait, in the ground plane [m].
        family: its nearest ancestors; None if they are not shown.
        pictures: pictures of the family, by births row.
        births: birth ids of the family, by births row.
        page: web page that plays its whole motion.
    """

    best: Best
    gait: tuple[Picture, ...]
    times_s: tuple[float, ...]
    film: tuple[Picture, ...]
    moved_m: float
    family: Family | None
    pictures: Mapping[int, Picture]
    births: Mapping[int, BirthId]
    page: str


def robot_picture(
    best: Best,
    births: pa.Table,
    relatives: Family,
    experiment: Experiment,
    simulate: Simulate,
    *,
    origin: Origin,
    has_family: bool,
) -> RobotPicture:
    """Return pictures of a robot, of its gait, and of its family, if it has one.

    Raises:
        SimulationDiverged: the physics diverged.
    """
    ((row,), *_) = relatives.levels
    (born,) = births.take([row]).to_pylist()
    own_island = island_experiment(experiment, best.island)
    settings = evaluation_settings_of(own_island, birth_point(born))
    paint = dict(zip(relatives.founders, FOUNDERS, strict=False))

    def colour(gene: int) -> Colour:
        founder = relatives.founder_of.get(gene)
        return MUTATED if founder is None else paint.get(founder, FOUNDERS[-1])

    def painted(member: int) -> Robot:
        genome, stored = (births[name][member].as_py() for name in ("genome", "robot"))
        robot = robot_of_birth(genome, stored, experiment)
        parts = tuple(
            replace(part, parameters=(*part.parameters[:-3], *colour(part.gene)))
            if part.gene
            else part
            for part in robot.parts
        )
        return Robot(parts, robot.brain)

    members = {*relatives.founders, *chain.from_iterable(relatives.levels)}
    pictures, names = {}, {}
    for member in sorted(members) if has_family else ():
        with RobotRenderer(painted(member), settings, size=_SMALL) as renderer:
            pictures[member] = renderer.picture()
        columns = (births["island"], births["birth"])
        names[member] = BirthId(*(column[member].as_py() for column in columns))
    birth = BirthId(best.birth_island, best.birth)
    own = Identity(replace(origin, island=best.island), birth, 0)
    robot, commands = painted(row), list[Floats]()
    alone = partial(simulate, identity=own)
    poses = recorded(alone, robot, settings, FILM_EVERY_S, commands)
    name = f"Robot {birth.name} of {best.folder.name}"
    facts = [{"fitness": best.fitness}]
    page = page_of({name: (robot, settings)}, [poses], [commands], facts, FILM_EVERY_S)
    return RobotPicture(
        best,
        *_motion(robot, settings, poses),
        relatives if has_family else None,
        pictures,
        names,
        page,
    )


def shown_experiment(run: LoadedRun) -> Experiment:
    """Return the experiment of a run without the sections that only judge robots.

    Pictures need no fitness function. Without those sections they need no plug-in of
    the user's either, unless it defines bodies or brains: of two runs with different
    sources of a plug-in, one process can import only one.
    """

    def without(entries: Mapping[str, Any]) -> dict[str, Any]:
        return {key: value for key, value in entries.items() if key not in _JUDGING}

    shown = without(json.loads(run.document))
    shown["islands"] = list(map(without, shown.get("islands") or ()))
    document = json.dumps(shown)
    if modules_named(document.encode()):
        allow_plugins_of(run.folder)
    return experiment_from_text(document, is_own=True)


def _motion(
    robot: Robot, settings: EvaluationSettings, poses: Sequence[Floats]
) -> tuple[tuple[Picture, ...], tuple[float, ...], tuple[Picture, ...], float]:
    """Return pictures from the middle of a robot's life on, by a fixed camera.

    Returns:
        Pictures of the gait and their times [s]; pictures of the film; the robot's way
        during the gait [m].
    """
    step = round(EVERY_S / FILM_EVERY_S)
    first = len(poses) // 2
    chosen = range(first, len(poses), step)[:FRAMES]
    filmed = poses[first : first + FRAMES * step]
    if _way_m(poses, chosen) < _SLOW_M:
        step = max(step, (len(poses) - 1 - first) // (FRAMES - 1))
        chosen = range(first, len(poses), step)[:FRAMES]
    times_s = tuple((at - first) * FILM_EVERY_S for at in chosen)

    def pictures(shown: Sequence[Floats], size: tuple[int, int]) -> tuple[Picture, ...]:
        with RobotRenderer(robot, settings, size=size, is_fine=size == _LARGE) as one:
            frame = one.framing(shown)
            return tuple(one.picture(pose, frame) for pose in shown)

    film = pictures(filmed, _FILMED)
    gait = pictures([poses[at] for at in chosen], _LARGE)
    return gait, times_s, film, _way_m(poses, chosen)


def _way_m(poses: Sequence[Floats], ticks: Sequence[int]) -> float:
    """Return the core's distance between the first and last tick, in the plane [m]."""
    first, last = poses[ticks[0]], poses[ticks[-1]]
    return float(np.linalg.norm(last[:2] - first[:2]))
