"""Orders of operators: checks, and the queue until they are carried out."""

from dataclasses import replace
from math import isfinite

from coordinator.arena.living import LivingRobots
from coordinator.arena.rows import Moment, death_record
from coordinator.evolution.breeding import Candidate
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
from schema.experiment.brains import neuron_kinds
from schema.experiment.document import Experiment, body_space
from schema.robot.brain import Brain
from schema.robot.genome import develop, walk
from schema.robot.ids import BirthId
from schema.robot.robot import Robot, check_robot


class Orders:
    """Orders to an arena.

    Attributes:
        is_paused: the arena is paused, or will be after its advance.
        ids: ids of all orders so far.
        pending: orders to carry out at the next decision.
        insertions: robots to insert as soon as there is room.
    """

    def __init__(self, experiment: Experiment, living: LivingRobots) -> None:
        self.is_paused = False
        self.pending: list[Order] = []
        self.insertions: list[Insert] = []
        self._experiment = experiment
        self._living = living
        self.ids: set[str] = set()

    def take(self, event: Commanded) -> None:
        """Store an order until the next decision.

        Raises:
            InvalidRobot: as in ``check_order``; nothing has changed.
        """
        check_order(event.order, self._experiment)
        self.ids.add(event.command_id)
        self.pending.append(event.order)

    def carry_out(self, moment: Moment) -> list[Record]:
        """Carry out the pending orders; return rows of removed robots."""
        records = []
        for order in self.pending:
            match order:
                case Pause() | Resume():
                    self.is_paused = isinstance(order, Pause)
                case Insert():
                    self.insertions.append(order)
                case Remove(birth=birth) if self._living.get(birth):
                    removed = self._living.remove(birth)
                    records.append(death_record(removed, "removed", moment))
                case ReplaceBrain(birth=birth, brain=brain):
                    living = self._living.get(birth)
                    robot = living and self._with_brain(living.robot, brain)
                    if living and robot:
                        self._living.replace_brain(living, robot)
        self.pending = []
        return records

    def _with_brain(self, robot: Robot, brain: Brain) -> Robot | None:
        """Return a robot with another brain; None if the brain does not fit it."""
        changed = replace(robot, brain=brain)
        try:
            _check(changed, self._experiment)
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
        inserted(order, BirthId(0, 0), experiment)
        if order.place is not None and not all(map(isfinite, order.place)):
            raise InvalidRobot(f"place: must be finite, got {order.place}")


def inserted(order: Insert, birth: BirthId, experiment: Experiment) -> Candidate:
    """Return the candidate, without parents, that an order inserts.

    Raises:
        InvalidRobot: the genome fits no robot of these part and neuron types.
    """
    space = body_space(experiment.space)
    for node, _, _ in walk(order.genome):
        if node.kind not in space:
            raise InvalidRobot(
                f"genome: part types are {', '.join(space)}, got {node.kind!r}"
            )
    robot = develop(order.genome, space)
    _check(robot, experiment)
    return Candidate(birth, 0, None, order.genome, robot)


def _check(robot: Robot, experiment: Experiment) -> None:
    """Raise unless a robot is well formed in an experiment."""
    space = experiment.space
    check_robot(robot, body_space(space), neuron_kinds(experiment.brain, space))
