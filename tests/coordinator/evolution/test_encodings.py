"""Encodings as islands use them: built-in and own ones, and what is refused."""

from collections.abc import Callable

import numpy as np
import pytest
from msgspec.structs import replace

from coordinator.evolution.encodings import encoding_of, outside_limits
from coordinator.evolution.generation import generate
from coordinator.evolution.random_streams import Purpose, stream
from coordinator.islands.rows import birth_record
from schema.errors import ExperimentError, InvalidRobot, UnknownPlugin
from schema.experiment.document import EncodingSection, Experiment, Space
from schema.parts import BUILT_IN
from schema.robot.genome import Genome
from schema.robot.ids import BirthId
from schema.robot.robot import Part, Robot, check_robot
from schema.wire.protobuf import decode_robot
from tests.coordinator.breeding import candidate

Own = Callable[..., Experiment]
THESIS = Experiment(name="test")
BIRTH = BirthId(2, 40)
GREY = (0.5, 0.5, 0.5)


def rng(attempt: int = 0) -> np.random.Generator:
    return stream(7, 0, BIRTH, attempt, Purpose.MATE)


def thesis_genomes() -> tuple[Genome, Genome]:
    first, second = (generate(rng(k), THESIS, BirthId(0, k)) for k in (1, 2))
    return first, second


def test_steps_of_the_thesis_encoding_keep_its_rules() -> None:
    encoding = encoding_of(THESIS)._encoding
    first, second = thesis_genomes()
    crossed = next(
        filter(None, (encoding.crossover(first, second, rng(k)) for k in range(9)))
    )
    mutated = next(
        filter(None, (encoding.mutate(crossed, rng(k), BIRTH) for k in range(9)))
    )
    assert len({first, second, crossed, mutated}) == 4
    for genome in (crossed, mutated):
        robot = encoding.develop(genome)
        check_robot(robot, BUILT_IN)
        assert outside_limits(robot, THESIS.space, BUILT_IN) == ""


@pytest.mark.parametrize(
    ("name", "nearest"),
    [("revolve-angel", "revolve-angle"), ("cpnn", "cppn"), ("CPPN", "cppn")],
)
def test_an_unknown_name_is_refused_with_the_nearest(name: str, nearest: str) -> None:
    with pytest.raises(
        UnknownPlugin, match=f"^encoding.type: must be one of .*{nearest}"
    ):
        encoding_of(Experiment(name="test", encoding=EncodingSection(type=name)))


@pytest.mark.parametrize(
    ("name", "parameters", "problem"),
    [
        ("revolve-angle", {"step": 1}, "encoding.parameters.step: no such key; al"),
        (
            "cppn",
            {"p_weight": 1.5},
            "encoding.parameters.p_weight: must be a number <=",
        ),
    ],
)
def test_wrong_parameters_are_refused(
    name: str, parameters: dict[str, float], problem: str
) -> None:
    section = EncodingSection(type=name, parameters=parameters)
    with pytest.raises(ExperimentError) as caught:
        encoding_of(Experiment(name="test", encoding=section))
    assert problem in str(caught.value)


def test_an_own_encoding_gets_its_parameters(own_encoding: Own) -> None:
    encoding = encoding_of(own_encoding(most_joints=3))
    genomes = [encoding.random(rng(k), BIRTH) for k in range(40)]
    assert {len(encoding.develop(each).parts) for each in genomes} == {3, 4}


def test_births_of_an_own_encoding_hold_the_robot(own_encoding: Own) -> None:
    experiment = own_encoding()
    born = candidate(experiment, BIRTH)
    row = birth_record(born, born.individual(0), encoding_of(experiment)).row
    assert decode_robot(row["robot"]) == born.robot


def use(experiment: Experiment) -> None:
    encoding = encoding_of(experiment)
    genome = encoding.random(rng(), BIRTH)
    encoding.to_bytes(genome)
    encoding.develop(genome)


WRONG = {
    "no method": ("def to_bytes", "def bytes_of", "Worms' has no 'to_bytes'$"),
    "raises": ("self.types = types", "1 / 0", r"raised Zero.* zero \(\w+_0.py:22\)$"),
    "no call": (", types, parameters)", ")", "raised TypeError: Worms.__init__()"),
    "types": ("rv.Robot(tuple(parts)", "rv.Robot((7,)", "raised AttributeError: "),
    "no bytes": (
        "return msgspec.json.encode",
        "return len",
        "to_bytes: must return <= 1048576 bytes",
    ),
}


@pytest.mark.parametrize("name", WRONG)
def test_errors_of_own_code_are_one_line(own_encoding: Own, name: str) -> None:
    old, new, problem = WRONG[name]
    experiment = own_encoding((old, new))
    with pytest.raises(ExperimentError, match=problem) as caught:
        use(experiment)
    assert "\n" not in str(caught.value)
    assert str(caught.value).startswith("encoding.type: test_errors")


def test_bytes_of_another_encoding_are_refused(own_encoding: Own) -> None:
    cppn = encoding_of(Experiment(name="test", encoding=EncodingSection(type="cppn")))
    encodings = [encoding_of(own_encoding()), encoding_of(THESIS), cppn]
    for one in encodings:
        data = one.to_bytes(one.random(rng(), BIRTH))
        for other in encodings:
            if other is not one:
                with pytest.raises(InvalidRobot, match="not a genome of encoding "):
                    other.from_bytes(data)


def test_most_encodings_take_no_robot(own_encoding: Own) -> None:
    encoding = encoding_of(own_encoding())
    robot = encoding.develop(encoding.random(rng(), BIRTH))
    with pytest.raises(InvalidRobot, match="makes no genome of a given robot"):
        encoding.from_robot(robot)


def test_an_encoding_that_takes_robots(own_encoding: Own) -> None:
    taking = """def from_robot(self, robot):
        if len(robot.parts) > 3:
            raise ValueError("more than two joints")
        return (Joint(1.0, 0.5),) * 2

    def mutate"""
    encoding = encoding_of(own_encoding(("def mutate", taking)))
    small, large = (
        Robot((Part("Core", -1, -1, -1, 0, GREY),) * count) for count in (1, 4)
    )
    assert len(encoding.develop(encoding.from_robot(small)).parts) == 3
    with pytest.raises(InvalidRobot, match=r"this robot: more than two joints$"):
        encoding.from_robot(large)


def chain(count: int, *, orientation: int = 0) -> Robot:
    parts = [Part("Core", -1, -1, -1, 0, GREY)]
    for index in range(count):
        slot = 1 if index else 0
        parts.append(Part("FixedBrick", index, slot, 0, orientation, GREY))
    return Robot(tuple(parts))


@pytest.mark.parametrize(
    ("robot", "space", "problem"),
    [
        (chain(2), Space(), ""),
        (chain(1), Space(), "the robot has 2 parts, outside space.min_parts = 3 and"),
        (chain(30), Space(), "the robot has 31 parts, outside space.min_parts = 3 and"),
        (chain(2, orientation=90), Space(), "part 1, a FixedBrick, is rotated by 90"),
        (chain(2, orientation=90), Space(planar=False), ""),
        (chain(2, orientation=180), Space(), "part 1, a FixedBrick, is rotated by 180"),
    ],
)
def test_limits_of_a_robot(robot: Robot, space: Space, problem: str) -> None:
    found = outside_limits(robot, space, BUILT_IN)
    assert found.startswith(problem)
    assert bool(found) == bool(problem)


def test_a_robot_outside_the_limits_is_a_failed_attempt(own_encoding: Own) -> None:
    experiment = own_encoding(("self.most = min(", "self.most = max("))
    experiment = replace(experiment, space=Space(max_parts=4))
    found = [candidate(experiment, BirthId(0, number)) for number in range(8)]
    assert all(len(one.robot.parts) <= 4 for one in found)
    assert any(one.attempt > 0 for one in found)


def test_an_encoding_that_never_keeps_the_limits_stops_the_run(
    own_encoding: Own,
) -> None:
    experiment = replace(own_encoding(), space=Space(max_parts=4, min_parts=4))
    experiment = replace(
        experiment, encoding=replace(experiment.encoding, parameters={"most_joints": 1})
    )
    broken = own_encoding(("count = int(", "count = 1 + 0 * int("))
    experiment = replace(experiment, encoding=broken.encoding)
    with pytest.raises(ExperimentError, match=r"the robot has 2 parts, outside space"):
        candidate(experiment, BirthId(0, 0))
