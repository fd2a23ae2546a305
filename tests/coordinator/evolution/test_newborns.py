"""What analyzers do at a birth, against the single steps of the encoding."""

from dataclasses import astuple
from typing import Any, cast

import numpy as np
import pytest
from msgspec.structs import replace

from analyzer.report import analyze
from coordinator.evolution.encodings import encoding_of
from coordinator.evolution.newborns import breed, founder
from schema.errors import ExperimentError, InvalidRobot, MalformedMessage
from schema.experiment.document import (
    EncodingSection,
    Experiment,
    Generation,
    Space,
    Vetting,
)
from schema.experiment.identity import Origin
from schema.experiment.settings import breeding_settings
from schema.parts import BodySpace
from schema.robot.ids import NOBODY, BirthId
from schema.robot.results import Report
from schema.robot.robot import Robot
from schema.wire.codec import decode, encode
from schema.wire.messages import Bred, Breed, Evaluate, Failure, Request
from schema.wire.protobuf import encode_robot

SEED, RUN = 2**40 + 3, 2
THESIS = Experiment(name="test")
CASES = {
    "thesis": THESIS,
    "crowded": Experiment(name="test", generation=Generation(parts_mean=18.0)),
    "cppn": Experiment(name="test", encoding=EncodingSection(type="cppn")),
}
GENERATE, MATE = 1, 3
"""Purposes of streams: part of what a seed means."""


def request(work: Any, experiment: Experiment = THESIS) -> Request:  # noqa: ANN401
    origin = Origin(SEED, RUN, 3)
    settings = breeding_settings(experiment)
    return Request("run", 1, 1, work, settings, origin=origin)


def bred(work: Breed, experiment: Experiment = THESIS) -> Bred:
    """Return the outcome; request and answer travel as bytes."""
    sent = decode(Request, encode(request(work, experiment)), 10**6)
    return decode(Bred, encode(breed(sent, analyze)), 10**6)


def rng(birth: BirthId, attempt: int, purpose: int) -> np.random.Generator:
    key = (RUN, birth.island, birth.number, attempt, purpose)
    return np.random.default_rng(np.random.SeedSequence(SEED, spawn_key=key))


@pytest.mark.parametrize("case", CASES)
def test_an_attempt_is_generation_or_mating_then_development_then_a_report(
    case: str,
) -> None:
    experiment = CASES[case]
    encoding, genomes, tried = encoding_of(experiment), list[bytes](), set[int]()
    for number in range(24):
        birth = BirthId(3, number)
        parents = (genomes[-1], genomes[number % len(genomes)]) if number >= 12 else ()
        found = bred(Breed(birth, 5, 10, parents), experiment)
        assert (found.birth, found.attempt) == (birth, 5)
        reasons = [*found.reasons, ""][:5]
        for attempt, why in enumerate(reasons, start=5):
            if parents:
                first, last = map(encoding.from_bytes, parents)
                genome = encoding.mate(first, last, rng(birth, attempt, MATE), birth)
            else:
                genome = encoding.random(rng(birth, attempt, GENERATE), birth)
            if genome is None:
                assert why == encoding.no_child
                continue
            robot = encoding.develop(genome)
            report = analyze(robot, encoding.types, experiment.vetting)
            assert report.reason == why
        tried.add(len(found.reasons))
        assert (found.child is None) == (len(found.reasons) == 5)
        if found.child is None:
            continue
        assert found.child.genome == encoding.to_bytes(genome)
        assert found.child.robot == robot
        encoding.check_newborn(found.child)
        genomes.append(found.child.genome)
    assert len(tried) > (case != "cppn")


def test_without_a_viable_body_all_attempts_have_a_reason() -> None:
    empty = Report(False, "no part has a motor", (), (0, 0, 0), (0, 0, 0), 0.1, 0)
    work = Breed(BirthId(0, 1), 5, 9)
    found = breed(request(work), lambda _robot, _types, _vetting: empty)
    assert found == Bred(work.birth, 5, ("no part has a motor",) * 4)


def test_a_given_founder_is_developed_and_vetted() -> None:
    child = bred(Breed(BirthId(0, 0), 0, 5)).child
    assert child is not None
    again = bred(Breed(BirthId(0, 9), 0, 1, founder=child.genome))
    assert again == Bred(BirthId(0, 9), 0, (), child)


def test_a_founder_is_the_first_random_robot_that_is_accepted() -> None:
    tried: list[Robot] = []

    def why_not(robot: Robot, _attempt: int) -> str:
        tried.append(robot)
        return "" if len(tried) > 7 else "no"

    assert founder(THESIS, SEED, 4, why_not) == tried[-1]
    assert len(set(map(encode_robot, tried))) == 8
    assert founder(THESIS, SEED, 4) == tried[0]


def vet(robot: Robot, space: BodySpace, vetting: Vetting) -> Report:
    raise AssertionError(astuple(cast("Any", (robot, space, vetting))))


@pytest.mark.parametrize(
    ("work", "error", "why"),
    [
        (Evaluate(NOBODY, Robot(())), MalformedMessage, "an analyzer breeds only"),
        (Breed(NOBODY, 0, 5, (b"\xff", b"x")), InvalidRobot, "not a genome of enc"),
    ],
)
def test_other_work_is_refused(work: Any, error: type[Exception], why: str) -> None:  # noqa: ANN401
    with pytest.raises(error, match=why):
        breed(request(work), vet)


def test_settings_of_another_kind_are_refused() -> None:
    with pytest.raises(ExperimentError, match="settings of a request"):
        breed(replace(request(Breed(NOBODY, 0, 5)), settings=b'{"space": 3}'), vet)


def test_a_failure_names_birth_and_reason() -> None:
    space = Space(min_parts=29, part_types=Space().part_types[::2][:2])
    rare = Experiment(name="test", space=space)
    found = breed(request(Breed(BirthId(3, 7), 0, 5), rare), vet)
    assert isinstance(found, Failure)
    assert found.reason.startswith("birth 7 of island 3: ")
    assert "space" in found.reason
