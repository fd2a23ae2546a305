"""Off-line populations: who lives stands on a grid, in neutral pose."""

from itertools import count

from analysis.viewer.body import neutral_pose
from analysis.viewer.entities import TimePoint, robot_path
from analysis.viewer.looks import BoxModels
from analysis.viewer.recording import Recording
from schema.robot.ids import BirthId
from schema.wire.updates import Level

SPACING_M = 0.6
COLUMNS = 5
"""Spots in a row; the first row stands nearest to the camera."""


class Gallery:
    """Whose portrait hangs where, island by island."""

    def __init__(self, recording: Recording) -> None:
        """Show nobody yet."""
        self._recording = recording
        self._spots: dict[int, dict[BirthId, int]] = {}

    def show(self, level: Level, models: BoxModels) -> None:
        """Show those who live, and no others.

        Args:
            level: with its members.
            models: of those that are known.
        """
        spots = self._spots.setdefault(level.island, {})
        when = TimePoint(None, level.births)
        members = set(level.members)
        for birth in sorted(set(spots).difference(members)):
            self._recording.died(robot_path(level.island, birth), when)
            del spots[birth]
        taken = set(spots.values())
        free = (spot for spot in count() if spot not in taken)
        for birth in level.members:
            if birth in spots or birth not in models:
                continue
            spots[birth] = next(free)
            path = robot_path(level.island, birth)
            self._recording.born(path, models[birth], when)
            self._recording.stands(
                path, *neutral_pose(models[birth], spot_place(spots[birth]))
            )


def spot_place(spot: int) -> tuple[float, float]:
    """Return where a spot of the grid is, from its middle column [m]."""
    row, column = divmod(spot, COLUMNS)
    return SPACING_M * (column - COLUMNS // 2), SPACING_M * (row - 1)
