"""What an operator may order: looked at before a journal keeps it."""

from dataclasses import replace
from math import isfinite

from coordinator.evolution.selection import Individual
from coordinator.islands.events import Insert, Order
from schema.errors import InvalidRobot
from schema.experiment.document import Experiment, body_space
from schema.parts import BodySpace
from schema.robot.brain import Brain
from schema.robot.genome import develop, walk
from schema.robot.ids import BirthId
from schema.robot.robot import Robot, check_robot


def check_order(order: Order, experiment: Experiment) -> None:
    """Raise unless an order can be carried out.

    Whether a robot that it names lives when it takes effect is nobody's fault.

    Raises:
        InvalidRobot: a genome that no robot of the experiment has, or a place that
            is none.
    """
    if isinstance(order, Insert):
        guest(order, BirthId(0, 0), body_space(experiment.space))
        if order.place is not None and not all(map(isfinite, order.place)):
            raise InvalidRobot(f"place: must be finite, got {order.place}")


def guest(order: Insert, birth: BirthId, space: BodySpace) -> tuple[Individual, Robot]:
    """Return whom an order inserts: somebody without parents.

    Raises:
        InvalidRobot: a genome that no robot of these part types has.
    """
    for node, _, _ in walk(order.genome):
        if node.kind not in space:
            raise InvalidRobot(
                f"genome: part types are {', '.join(space)}, got {node.kind!r}"
            )
    robot = develop(order.genome, space)
    check_robot(robot, space)
    return Individual(birth, order.genome, 0.0, 1, None), robot


def rewired(robot: Robot, brain: Brain, space: BodySpace) -> Robot | None:
    """Return a robot with another brain; None if that does not fit its body."""
    changed = replace(robot, brain=brain)
    try:
        check_robot(changed, space)
    except InvalidRobot:
        return None
    return changed
