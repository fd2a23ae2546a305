"""The way back from a robot to a genome."""

from hypothesis import given
from hypothesis import strategies as st
from hypothesis.strategies import DataObject, SearchStrategy

from schema.ancestor import genome_of
from schema.genome import develop
from schema.parts import BUILT_IN
from schema.robot import Robot


@given(data=st.data())
def test_development_gives_the_robot_back(
    robots: SearchStrategy[Robot], data: DataObject
) -> None:
    robot = data.draw(robots)
    assert develop(genome_of(robot), BUILT_IN) == robot
    again = genome_of(robot)
    assert genome_of(develop(again, BUILT_IN)) == again
