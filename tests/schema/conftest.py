"""Random genomes and robots as fixtures."""

from collections.abc import Callable

import pytest
from hypothesis.strategies import SearchStrategy

from schema.robot.genome import Genome, Node
from schema.robot.robot import Robot
from tests.schema import robots as made


@pytest.fixture(scope="session")
def genomes() -> SearchStrategy[Genome]:
    """Well-formed genomes; some of their paths lead nowhere."""
    return made.random_genomes()


@pytest.fixture(scope="session")
def robots() -> SearchStrategy[Robot]:
    """Well-formed robots."""
    return made.random_robots()


@pytest.fixture(scope="session")
def node() -> Callable[..., Node]:
    """A node with default parameters and simple outputs; the rest by keyword."""
    return made.node
