"""Errors of plug-ins late in a run: each names its birth and its island."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from msgspec.structs import replace

from coordinator.evolution.breeding import Breeder, Candidate, Individual
from coordinator.evolution.encodings import encoding_of
from coordinator.islands.events import Ask
from coordinator.islands.rows import birth_record
from coordinator.run.learners import Learners
from schema.errors import ExperimentError
from schema.experiment.document import (
    BrainSection,
    EncodingSection,
    Experiment,
    SelectionSection,
)
from schema.experiment.identity import Origin
from schema.experiment.learning import Learning
from schema.plugins import permission
from schema.robot.ids import BirthId

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


@pytest.fixture
def lab(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, _own_brains: None) -> str:
    """Return the name of a module whose plug-ins raise, which is allowed."""
    name = f"late_{tmp_path.name.replace('-', '_')}"
    file = tmp_path / f"{name}.py"
    file.write_text(LAB)
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setattr(permission, "_allowed", {**permission._allowed, name: file})
    return name


def living(breeder: Breeder) -> list[Individual]:
    found = []
    for number in range(6):
        born = breeder.candidate(BirthId(3, number), 0, ())
        assert born is not None
        found.append(replace(born.individual(0), fitness=float(number)))
    return found


def parents(experiment: Experiment) -> None:
    breeder = Breeder(experiment, 1, 0)
    breeder.candidate(BIRTH, 0, living(breeder))


def survivors(experiment: Experiment) -> None:
    breeder = Breeder(experiment, 1, 0)
    brood = [
        replace(one, birth=BirthId(3, 195 + at))
        for at, one in enumerate(living(breeder))
    ]
    breeder.survivors([], brood)


def row(experiment: Experiment) -> None:
    found = Breeder(experiment, 1, 0).candidate(BIRTH, 0, ())
    assert isinstance(found, Candidate)
    birth_record(found, found.individual(0), encoding_of(experiment))


def learner(experiment: Experiment) -> None:
    ask = Ask(BIRTH, number=0, start=(0.5,), told=(), most=3)
    Learners({3: experiment}, Origin(seed=1, run=0)).answer(ask)


Case = tuple[Callable[[Experiment], None], str, str, Callable[[str], Any]]
# What is done, the key that the error names, the section and its content.
CASES: dict[str, Case] = {
    "parents": (
        parents,
        "selection.parents",
        "selection",
        lambda lab: SelectionSection(parents=f"{lab}:fails"),
    ),
    "parents that end": (
        parents,
        "selection.parents",
        "selection",
        lambda lab: SelectionSection(parents=f"{lab}:ends"),
    ),
    "survivors": (
        survivors,
        "selection.survivors",
        "selection",
        lambda lab: SelectionSection(population=4, survivors=f"{lab}:fails"),
    ),
    "encoding": (
        parents,
        "encoding.type",
        "encoding",
        lambda lab: EncodingSection(type=f"{lab}:Crossing"),
    ),
    "genome": (
        row,
        "encoding.type",
        "encoding",
        lambda lab: EncodingSection(type=f"{lab}:Writing"),
    ),
    "brain": (parents, "", "brain", lambda lab: BrainSection(type=f"{lab}:Wave")),
    "learner": (
        learner,
        "learning.learner",
        "learning",
        lambda lab: Learning(learner=f"{lab}:Asking", budget=4),
    ),
}


@pytest.mark.parametrize("name", list(CASES))
def test_an_error_names_birth_and_island(name: str, lab: str) -> None:
    act, key, section, content = CASES[name]
    with pytest.raises(ExperimentError) as caught:
        act(Experiment(name="x", **{section: content(lab)}))
    message = str(caught.value)
    assert message.startswith(f"birth 200 of island 3: {key}")
    assert f"{lab}.py" in message
    assert ("SystemExit: 3" if "end" in name else "LookupError") in message
    assert "\n" not in message
