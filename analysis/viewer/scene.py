"""The scene of a run: islands, arenas, walls and ground of an experiment."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from analysis.viewer.ground import Surface, surfaces
from schema.experiment.document import (
    Experiment,
    body_space,
    island_experiments,
    light_of,
)
from schema.experiment.grid import Grid
from schema.mjcf.model import ring_wall
from schema.parts import BodySpace
from schema.robot.ids import BirthId
from schema.robot.trace import Floats

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
        walls: walls of each island, (W, 10): centre [m], attitude w, x, y, z, and
            half sizes [m].
        surfaces: surfaces above the plane of each island.
        grid: cells over measures, which have a map of their own.
    """

    islands: tuple[int, ...]
    arenas: frozenset[int]
    extent_m: float
    space: BodySpace
    walls: tuple[Floats, ...]
    surfaces: tuple[tuple[Surface, ...], ...]
    grid: Grid | None = None

    def below(self, births: Sequence[BirthId]) -> tuple[Surface, ...]:
        """Return the ground below robots, if they are shown at their recorded places.

        This applies to robots of one arena, and to a single off-line robot.
        """
        islands = [birth.island for birth in births]
        is_one_place = len(set(islands)) == 1
        if not is_one_place or (len(islands) > 1 and islands[0] not in self.arenas):
            return ()
        return self.surfaces[self.islands.index(islands[0])]

    def omissions(self, births: Sequence[BirthId]) -> list[str]:
        """Return lines about the ground that robots simulated again do not show."""
        grounds = zip(self.islands, self.surfaces, strict=True)
        uneven = {island for island, surfaces in grounds if surfaces}
        what = "rough ground and scenery are not shown"
        lines = []
        if uneven - self.arenas and not births:
            lines.append(
                f"off-line robots stand side by side on a plane: {what}; a single "
                "--robot shows them"
            )
        if uneven & {birth.island for birth in births} and not self.below(births):
            lines.append(
                "robots that were simulated alone move side by side on a plane: "
                f"{what}, although they were there; a single --robot shows them"
            )
        return lines


def scene_of(experiment: Experiment) -> Scene:
    """Return the scene of an experiment.

    Raises:
        ExperimentError: a plug-in with part types is missing, or scenery is invalid.
    """
    settings = island_experiments(experiment)
    arenas = [island.arena for island in settings]
    reaches = [
        _MARGIN * max(0.5 * arena.wall_diameter_m, arena.birth_radius_m)
        if arena
        else _GALLERY_M
        for arena in arenas
    ]
    return Scene(
        tuple(range(len(settings))),
        frozenset(number for number, arena in enumerate(arenas) if arena),
        max(reaches),
        body_space(experiment.space),
        tuple(ring_wall(arena) if arena else np.zeros((0, 10)) for arena in arenas),
        tuple(
            surfaces(
                island.environment,
                island.simulation,
                light_of(island.environment, island.arena),
            )
            for island in settings
        ),
        experiment.grid,
    )
