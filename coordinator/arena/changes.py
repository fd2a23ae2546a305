"""What is to be done to a world before it advances, as it comes together."""

from dataclasses import replace

from coordinator.arena.place import Place
from schema.robot.ids import BirthId
from schema.robot.robot import Robot
from schema.wire.arena import BrainChange, Changes, Insertion


class PendingChanges:
    """Changes that nobody has been told of yet."""

    def __init__(self) -> None:
        """Begin without any."""
        self._removals: list[BirthId] = []
        self._insertions: dict[BirthId, Insertion] = {}
        self._brains: dict[BirthId, BrainChange] = {}

    def insert(self, birth: BirthId, robot: Robot, place: Place) -> None:
        """Have a robot put in."""
        self._insertions[birth] = Insertion(birth, robot, place)

    def remove(self, birth: BirthId) -> None:
        """Have a robot taken out; one that was never put in just is not."""
        self._brains.pop(birth, None)
        if self._insertions.pop(birth, None) is None:
            self._removals.append(birth)

    def rewire(self, birth: BirthId, robot: Robot) -> None:
        """Have a robot's brain replaced by that of ``robot``."""
        inserted = self._insertions.get(birth)
        if inserted is None:
            self._brains[birth] = BrainChange(birth, robot.brain)
        else:
            self._insertions[birth] = replace(inserted, robot=robot)

    def take(self) -> Changes:
        """Return all changes, and begin anew."""
        changes = Changes(
            tuple(self._removals),
            tuple(self._insertions.values()),
            tuple(self._brains.values()),
        )
        self._removals, self._insertions, self._brains = [], {}, {}
        return changes
