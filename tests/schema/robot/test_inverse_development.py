"""Genomes of given robots."""

from hypothesis import given
from msgspec.structs import replace

from schema.parts import BUILT_IN
from schema.robot.genome import develop
from schema.robot.inverse_development import genome_of
from schema.robot.robot import Robot
from tests.schema.robots import random_robots


def unordered(robot: Robot) -> Robot:
    """Return a robot with sorted connections."""
    edges = sorted(robot.brain.connections, key=lambda edge: (edge.source, edge.target))
    return replace(robot, brain=replace(robot.brain, connections=tuple(edges)))


@given(robot=random_robots())
def test_development_inverts_genome_of(robot: Robot) -> None:
    again = develop(genome_of(robot), BUILT_IN)
    assert unordered(again) == unordered(robot)
    # From there on nothing changes any more, the order included.
    assert develop(genome_of(again), BUILT_IN) == again
