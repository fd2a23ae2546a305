"""Off-line populations side by side, archive maps, and the ancestry graph."""

from collections import OrderedDict
from collections.abc import Callable, Iterable, Mapping
from itertools import count, groupby
from operator import attrgetter

import numpy as np
import numpy.typing as npt

from analysis.viewer.body import BoxModel, neutral_pose
from analysis.viewer.entities import AncestryNode, TimePoint, robot_path
from analysis.viewer.recording import Recording
from schema.experiment.grid import Grid
from schema.robot.ids import BirthId
from schema.wire.elites import Elite
from schema.wire.updates import Birth, Level, RecordedDeath

SPACING_M = 0.6
COLUMNS = 5
"""Spots in a row; the first row is nearest to the camera."""


_PALE, _DARK = np.array([222.0, 235.0, 247.0]), np.array([8.0, 69.0, 148.0])
"""Colours of the least and the most fit cells."""
BoxModels = Mapping[BirthId, Callable[[], BoxModel]]
"""Functions that return the box models of the known robots."""
_MOST = 150
"""Births that are shown; more cannot be distinguished or drawn in time."""
_EVERY = 10
"""Births between two drawings: Rerun needs the whole graph each time."""


class Gallery:
    """Off-line populations: living robots on a grid, in neutral pose."""

    def __init__(self, recording: Recording) -> None:
        self._recording = recording
        self._spots: dict[int, dict[BirthId, int]] = {}

    def show(self, level: Level, models: BoxModels) -> None:
        """Show the members of a population, and remove all other robots."""
        spots = self._spots.setdefault(level.island, {})
        when = TimePoint(None, level.births)
        for birth in sorted(set(spots).difference(level.members)):
            self._recording.remove(robot_path(level.island, birth), when)
            del spots[birth]
        taken = set(spots.values())
        free = (spot for spot in count() if spot not in taken)
        for birth in level.members:
            if birth in spots or birth not in models:
                continue
            spots[birth] = next(free)
            path, model = robot_path(level.island, birth), models[birth]()
            self._recording.log_boxes(path, model, when)
            place = neutral_pose(model, spot_place(spots[birth]))
            self._recording.log_place(path, *place)


def spot_place(spot: int) -> tuple[float, float]:
    """Return the place of a spot of the grid [m]; the middle column is at x = 0."""
    row, column = divmod(spot, COLUMNS)
    return SPACING_M * (column - COLUMNS // 2), SPACING_M * (row - 1)


class ArchiveMaps:
    """Maps of the fitness of cells, over the first two measures of a grid.

    Of further measures each cell shows the fittest. Pale cells are the least fit, dark
    ones the fittest so far; white ones have not been reached.
    """

    def __init__(self, recording: Recording, grid: Grid) -> None:
        self._recording = recording
        across, along = (*grid.bins, 1)[:2]
        self._size = (along, across)
        self._fitness: dict[int, npt.NDArray[np.float64]] = {}

    def add(
        self, elites: Iterable[Elite], when: Callable[[int, int], TimePoint]
    ) -> None:
        """Add elites; log the map of each island and number of births that has some.

        ``when`` returns the time of an island and its number of births.
        """
        key = attrgetter("island", "births")
        for (island, births), group in groupby(sorted(elites, key=key), key):
            fitness = self._fitness.setdefault(island, np.full(self._size, np.nan))
            for one in group:
                x, y = (*one.cell, 0, 0)[:2]
                if y < self._size[0] and x < self._size[1]:
                    fitness[y, x] = np.fmax(fitness[y, x], one.fitness)
            self._recording.archive(island, _pixels(fitness), when(island, births))


def _pixels(fitness: npt.NDArray[np.float64]) -> npt.NDArray[np.uint8]:
    """Return cells as an image, (H, W, 3), the first row at the bottom."""
    low, high = np.nanmin(fitness), np.nanmax(fitness)
    share = (fitness - low) / (high - low) if high > low else fitness - low
    colours = _PALE + share[..., np.newaxis] * (_DARK - _PALE)
    shown = np.where(np.isnan(colours), 255.0, colours)
    return np.round(shown[::-1]).astype(np.uint8)


class Lineage:
    """Ancestry of the newest births, with those that are alive."""

    def __init__(self, recording: Recording) -> None:
        self._recording = recording
        self._entries: OrderedDict[BirthId, AncestryNode] = OrderedDict()
        self._known: set[BirthId] = set()
        self._latest = TimePoint()
        self._undrawn = 0

    def add(self, one: Birth) -> bool:
        """Add a birth; return whether it is new."""
        if one.birth in self._known:
            return False
        if self._undrawn >= _EVERY:
            self.draw()
        self._entries[one.birth] = AncestryNode(one, len(self._known))
        self._known.add(one.birth)
        if len(self._entries) > _MOST:
            self._entries.popitem(last=False)
        self._latest = TimePoint(one.sim_time_s, one.births)
        self._undrawn += 1
        return True

    def remove(self, gone: RecordedDeath) -> None:
        """Mark a robot as dead."""
        if gone.birth in self._entries:
            self._entries[gone.birth].is_alive = False

    def keep(self, level: Level) -> None:
        """Mark all robots of an island as dead that are not in its population."""
        members = set(level.members)
        for birth, entry in self._entries.items():
            is_here = birth.island == level.island
            if is_here and entry.birth.births <= level.births:
                entry.is_alive = birth in members

    def draw(self) -> None:
        """Draw the graph if there are new births."""
        if self._undrawn:
            self._undrawn = 0
            self._recording.ancestry(list(self._entries.values()), self._latest)
