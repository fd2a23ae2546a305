"""Orders of operators: checks, and the queue until they are carried out."""

from math import isfinite

from msgspec.structs import replace

from coordinator.arena.infancy import Infancy
from coordinator.arena.living import LivingRobots, Moment, death_record
from coordinator.evolution.breeding import Candidate, Individual
from coordinator.evolution.encodings import IslandEncoding, encoding_of
from coordinator.islands.events import (
    Commanded,
    Insert,
    Order,
    Pause,
    Record,
    Remove,
    ReplaceBrain,
    Resume,
)
from schema.errors import InvalidRobot
from schema.experiment.document import Experiment
from schema.robot.brain import Brain
from schema.robot.ids import BirthId
from schema.robot.robot import Robot


class Orders:
    """Orders to an arena.

    Attributes:
        is_paused: the arena is paused, or will be after its advance.
        ids: ids of all orders so far.
        pending: orders to carry out at the next decision.
        insertions: robots to insert as soon as there is room.
    """

    def __init__(
        self, experiment: Experiment, living: LivingRobots, infancy: Infancy | None
    ) -> None:
        self.is_paused = False
        self.pending: list[Order] = []
        self.insertions: list[Insert] = []
        self._experiment = experiment
        self._encoding = encoding_of(experiment)
        self._living = living
        self._infancy = infancy
        self.ids: set[str] = set()

    @property
    def prevent_extinction(self) -> bool:
        """A robot is to be inserted, at the next decision or when there is room."""
        return bool(self.insertions) or any(
            isinstance(order, Insert) for order in self.pending
        )

    def take(self, event: Commanded) -> None:
        """Store an order until the next decision.

        Raises:
            InvalidRobot: as in ``check_order``; nothing has changed.
        """
        check_order(event.order, self._experiment)
        self.ids.add(event.command_id)
        self.pending.append(event.order)

    def carry_out(self, moment: Moment) -> list[Record]:
        """Carry out the pending orders.

        The infancy of a robot that is removed or gets a brain ends.

        Returns:
            Rows of removed robots, and of the trials of infants.
        """
        records: list[Record] = []
        for order in self.pending:
            match order:
                case Pause() | Resume():
                    self.is_paused = isinstance(order, Pause)
                case Insert():
                    self.insertions.append(order)
                case Remove(birth=birth) if self._living.get(birth):
                    records += self.end_infancy(birth, "removed", moment)
                    removed = self._living.remove(birth)
                    records.append(death_record(removed, "removed", moment))
                case ReplaceBrain(birth=birth, brain=brain):
                    records += self._replace_brain(birth, brain, moment)
        self.pending = []
        return records

    def _replace_brain(
        self, birth: BirthId, brain: Brain, moment: Moment
    ) -> list[Record]:
        """Replace a brain; no effect if the robot is dead or the brain does not fit."""
        living = self._living.get(birth)
        robot = living and self._with_brain(living.robot, brain)
        if not (living and robot):
            return []
        was_infant = living.is_infant
        rows = self.end_infancy(birth, "brain replaced", moment)
        self._living.replace_brain(living, robot, restarts_window=was_infant)
        return rows

    def end_infancy(self, birth: BirthId, why: str, moment: Moment) -> list[Record]:
        """End the infancy of a robot, if it is an infant; return its rows."""
        if self._infancy is None:
            return []
        return self._infancy.end(birth, why, moment.sim_time_s)

    def _with_brain(self, robot: Robot, brain: Brain) -> Robot | None:
        """Return a robot with another brain; None if the brain does not fit it."""
        changed = replace(robot, brain=brain)
        try:
            self._encoding.check(changed)
        except InvalidRobot:
            return None
        return changed


def check_order(order: Order, experiment: Experiment) -> None:
    """Raise if an order is invalid.

    An order that names a robot which is dead when it takes effect is valid.

    Raises:
        InvalidRobot: the genome fits no robot of the experiment, or the place is not
            finite.
    """
    if isinstance(order, Insert):
        inserted(order, BirthId(0, 0), encoding_of(experiment))
        if order.place is not None and not all(map(isfinite, order.place)):
            raise InvalidRobot(f"place: must be finite, got {order.place}")


def inserted(order: Insert, birth: BirthId, encoding: IslandEncoding) -> Candidate:
    """Return the candidate that an order inserts.

    Raises:
        InvalidRobot: not a genome of this encoding, or its robot does not fit the
            part types or the brain type.
    """
    genome = encoding.from_bytes(order.genome)
    robot = encoding.develop(genome)
    encoding.check(robot)
    made = encoding.newborn(genome, robot)
    couple = tuple(
        Individual(parent, b"", fitness=0.0, rank=order.rank - 1, generation=None)
        for parent in order.parents
    )
    return Candidate(birth, 0, couple or None, made.genome, robot, made.connections)
