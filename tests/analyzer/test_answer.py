"""Encoded answers to encoded requests."""

import pytest

from analyzer.report import analyze, answer
from schema.errors import ExperimentError, InvalidRobot, MalformedMessage
from schema.experiment.document import Experiment, body_space
from schema.experiment.settings import vetting_settings
from schema.robot.brain import Brain, Neuron
from schema.robot.robot import Part, Robot
from schema.wire.codec import decode_answer, encode_request
from schema.wire.protobuf import encode_robot

GREY = (0.5, 0.5, 0.5)
EXPERIMENT = Experiment(name="test")
SETTINGS = vetting_settings(EXPERIMENT)
INPUTS = tuple(Neuron("input", "Input", 0) for _ in range(6))
MOTOR = Neuron("output", "Simple", 1, (0.0, 0.5))
ROBOT = Robot(
    (Part("Core", -1, -1, -1, 0, GREY), Part("ActiveHinge", 0, 2, 0, 90, GREY)),
    Brain((*INPUTS, MOTOR)),
)


def request_for(
    robot: Robot, settings: bytes = SETTINGS, *, epoch: int = 1, number: int = 1
) -> bytes:
    """Return the bytes of a request about a robot, its brain included."""
    return encode_request(
        run="run",
        epoch=epoch,
        number=number,
        settings=settings,
        robot=encode_robot(robot),
    )


def test_an_answer_holds_the_report_and_the_request_number() -> None:
    request = request_for(ROBOT, epoch=3, number=17)
    found = decode_answer(answer(request))
    space = body_space(EXPERIMENT.space)
    assert (found.epoch, found.number) == (3, 17)
    assert found.result == analyze(ROBOT, space, EXPERIMENT.vetting)
    assert found.wall_s > 0


@pytest.mark.parametrize(
    "brain",
    [Brain(), Brain((MOTOR, *INPUTS)), Brain((Neuron("output", "None", 7),))],
    ids=["none", "out of order", "of another body"],
)
def test_the_brain_of_a_request_is_ignored(brain: Brain) -> None:
    found = decode_answer(answer(request_for(Robot(ROBOT.parts, brain))))
    assert found.result == decode_answer(answer(request_for(ROBOT))).result


def test_a_brain_without_a_body_is_malformed() -> None:
    with pytest.raises(MalformedMessage, match="at least the core"):
        answer(request_for(Robot((), ROBOT.brain)))


def test_a_slot_that_a_type_does_not_have_is_rejected() -> None:
    hinge = Part("ActiveHinge", 0, 4, 0, 90, GREY)
    with pytest.raises(InvalidRobot, match=r"parent_slot: Core has slots 0..3, got 4"):
        answer(request_for(Robot((ROBOT.parts[0], hinge))))


def test_a_robot_that_the_space_does_not_allow_is_rejected() -> None:
    light = Part("LightSensor", 0, 2, 0, 0, GREY)
    robot = Robot((ROBOT.parts[0], light), Brain(INPUTS))
    request = request_for(robot)
    with pytest.raises(InvalidRobot, match="LightSensor"):
        answer(request)


def test_settings_of_another_kind_are_rejected() -> None:
    request = request_for(ROBOT, b'{"space": 3}')
    with pytest.raises(ExperimentError, match="settings of a request"):
        answer(request)


def test_bytes_that_are_no_request_are_malformed() -> None:
    with pytest.raises(MalformedMessage):
        answer(b"\xff\xff\xff")
