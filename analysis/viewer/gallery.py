"""Box models of a run's robots, and off-line populations on a grid."""

from itertools import count

from analysis.viewer.body import BoxModel, box_model, neutral_pose
from analysis.viewer.entities import TimePoint, robot_path
from analysis.viewer.recording import Recording
from schema.parts import BodySpace
from schema.robot.ids import BirthId
from schema.robot.robot import Robot
from schema.wire.updates import Level

SPACING_M = 0.6
COLUMNS = 5
"""Spots in a row; the first row is nearest to the camera."""


class BoxModels:
    """Box models of a run's robots, each made when it is first used."""

    def __init__(self, space: BodySpace) -> None:
        self._space = space
        self._bodies: dict[BirthId, Robot] = {}
        self._made: dict[BirthId, BoxModel] = {}

    def add(self, birth: BirthId, body: Robot) -> None:
        """Add the body of a robot, unless it is known."""
        self._bodies.setdefault(birth, body)

    def __contains__(self, birth: BirthId) -> bool:
        return birth in self._bodies

    def __getitem__(self, birth: BirthId) -> BoxModel:
        if birth not in self._made:
            body = self._bodies[birth]
            self._made[birth] = box_model(body, self._space, is_plain=True)
        return self._made[birth]


class Gallery:
    """Off-line populations: living robots on a grid, in neutral pose."""

    def __init__(self, recording: Recording) -> None:
        self._recording = recording
        self._spots: dict[int, dict[BirthId, int]] = {}

    def show(self, level: Level, models: BoxModels) -> None:
        """Show the members of a population, and remove all other robots.

        Args:
            level: the population.
            models: models of the known robots.
        """
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
            path = robot_path(level.island, birth)
            self._recording.log_boxes(path, models[birth], when)
            self._recording.log_place(
                path, *neutral_pose(models[birth], spot_place(spots[birth]))
            )


def spot_place(spot: int) -> tuple[float, float]:
    """Return the place of a spot of the grid [m]; the middle column is at x = 0."""
    row, column = divmod(spot, COLUMNS)
    return SPACING_M * (column - COLUMNS // 2), SPACING_M * (row - 1)
