"""The scene of a run: islands, arenas, walls and ground of an experiment."""

from collections.abc import Iterable
from dataclasses import dataclass
from math import cos, pi, sin, tan

import numpy as np

from analysis.viewer.body import Float32s
from analysis.viewer.ground import Surface, surfaces
from schema.experiment.document import Arena, Experiment, body_space, island_count
from schema.experiment.document import island_experiment as of_island
from schema.parts import BodySpace
from schema.robot.ids import BirthId

_MARGIN = 1.3
_GALLERY_M = 2.0


@dataclass(frozen=True, slots=True)
class Scene:
    """The islands of a run, as a viewer shows them.

    Attributes:
        islands: numbers of the islands.
        arenas: islands on which robots live together, in simulated time.
        extent_m: half width of the largest arena or population grid [m].
        space: the part types.
        walls: walls of each island, (W, 10): centre [m], attitude x, y, z, w, and
            half sizes [m].
        surfaces: surfaces above the plane of each island.
    """

    islands: tuple[int, ...]
    arenas: frozenset[int]
    extent_m: float
    space: BodySpace
    walls: tuple[Float32s, ...]
    surfaces: tuple[tuple[Surface, ...], ...]

    def below(self, births: Iterable[BirthId]) -> tuple[Surface, ...]:
        """Return the ground below robots, if they are shown at their recorded places.

        This applies to robots of one arena, and to a single off-line robot.
        """
        islands = [birth.island for birth in births]
        is_one_place = len(set(islands)) == 1
        if not is_one_place or (len(islands) > 1 and islands[0] not in self.arenas):
            return ()
        return self.surfaces[self.islands.index(islands[0])]


def scene_of(experiment: Experiment) -> Scene:
    """Return the scene of an experiment.

    Raises:
        ExperimentError: a plug-in with part types is missing, or scenery is invalid.
    """
    islands = tuple(range(island_count(experiment)))
    settings = [of_island(experiment, each) for each in islands]
    arenas = [each.arena for each in settings]
    reaches = [
        _MARGIN * max(0.5 * arena.wall_diameter_m, arena.birth_radius_m)
        if arena
        else _GALLERY_M
        for arena in arenas
    ]
    return Scene(
        islands,
        frozenset(each for each in islands if arenas[each] is not None),
        max(reaches),
        body_space(experiment.space),
        tuple(map(_ring_wall, arenas)),
        tuple(surfaces(each.environment, each.simulation) for each in settings),
    )


def _ring_wall(arena: Arena | None) -> Float32s:
    """Return the walls of an arena, as ``schema.mjcf.world`` builds them."""
    if arena is None or not arena.wall_diameter_m:
        return np.zeros((0, 10), np.float32)
    half, height = 0.5 * arena.wall_thickness_m, 0.5 * arena.wall_height_m
    centre = 0.5 * arena.wall_diameter_m + half
    length = (centre + half) * tan(pi / arena.wall_segments)
    walls = []
    for index in range(arena.wall_segments):
        angle = 2.0 * pi * index / arena.wall_segments
        place = (centre * cos(angle), centre * sin(angle), height)
        attitude = (0.0, 0.0, sin(0.5 * angle), cos(0.5 * angle))
        walls.append((*place, *attitude, half, length, height))
    return np.array(walls, np.float32)
