"""Off-line populations on a grid."""

from collections.abc import Callable, Mapping
from itertools import count

from analysis.viewer.body import BoxModel, neutral_pose
from analysis.viewer.entities import TimePoint, robot_path
from analysis.viewer.recording import Recording
from schema.robot.ids import BirthId
from schema.wire.updates import Level

SPACING_M = 0.6
COLUMNS = 5
"""Spots in a row; the first row is nearest to the camera."""


BoxModels = Mapping[BirthId, Callable[[], BoxModel]]
"""Functions that return the box models of the known robots."""


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
