"""Errors of plug-ins late in a run: each names its birth and its island."""

from collections.abc import Callable

import pytest
from msgspec.structs import replace

from coordinator.evolution.breeding import Breeder, Individual
from coordinator.islands.events import Ask
from coordinator.run.learners import Learners
from schema.errors import ExperimentError
from schema.experiment.document import Experiment
from schema.experiment.identity import Origin
from schema.robot.ids import BirthId
from tests.coordinator.breeding import candidate
from tests.documents import parse

LAB = """
import my_brains
from coordinator.evolution.revolve_angle import RevolveAngle

def fails(*arguments):
    raise LookupError("late")

def ends(*arguments):
    exit(3)

class Crossing(RevolveAngle):
    mate = fails

class Writing(RevolveAngle):
    to_bytes = fails

class Wave(my_brains.Wave):
    vary = fails

class Asking:
    def __init__(self, start, sigma, parameters):
        pass
    ask = tell = fails
"""
BIRTH = BirthId(3, 200)


def living(experiment: Experiment, first: int = 0) -> list[Individual]:
    return [
        replace(candidate(experiment, BirthId(3, first + n)).individual(0), fitness=n)
        for n in range(6)
    ]


def parents(experiment: Experiment) -> None:
    candidate(experiment, BIRTH, living(experiment))


def survivors(experiment: Experiment) -> None:
    Breeder(experiment, 1, 0).survivors([], living(experiment, 195))


def random(experiment: Experiment) -> None:
    candidate(experiment, BIRTH)


def learner(experiment: Experiment) -> None:
    ask = Ask(BIRTH, number=0, start=(0.5,), told=(), most=3)
    Learners({3: experiment}, Origin(seed=1, run=0)).answer(ask)


# What is done, the keys of the document, and the key that the error names.
CASES = [
    (parents, 'selection.parents = "LAB:fails"', "selection.parents"),
    (parents, 'selection.parents = "LAB:ends"', "selection.parents"),
    (
        survivors,
        'selection.population = 5\nselection.survivors = "LAB:fails"',
        "selection.survivors",
    ),
    (parents, 'encoding.type = "LAB:Crossing"', "encoding.type"),
    (random, 'encoding.type = "LAB:Writing"', "encoding.type"),
    (parents, 'brain.type = "LAB:Wave"', ""),
    (learner, '[learning]\nlearner = "LAB:Asking"\nbudget = 4', "learning.learner"),
]


@pytest.mark.usefixtures("_own_brains")
@pytest.mark.parametrize(("act", "text", "key"), CASES)
def test_an_error_names_birth_and_island(
    act: Callable[[Experiment], None],
    text: str,
    key: str,
    own_module: Callable[[str], str],
) -> None:
    lab = own_module(LAB)
    with pytest.raises(ExperimentError) as caught:
        act(parse(text.replace("LAB", lab)))
    message = str(caught.value)
    assert message.startswith(f"birth 200 of island 3: {key}")
    assert f"{lab}.py" in message
    assert ("SystemExit: 3" if "ends" in text else "LookupError") in message
    assert "\n" not in message
