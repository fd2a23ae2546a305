"""Answers to requests."""

import pytest

from analyzer.report import analyze, answer
from schema.errors import ExperimentError, InvalidRobot, MalformedMessage
from schema.experiment.document import Experiment, body_space
from schema.experiment.settings import vetting_settings
from schema.robot.brain import Brain, Neuron
from schema.robot.ids import BirthId
from schema.robot.robot import Part, Robot
from schema.wire.messages import Evaluate, Request, Vet

GREY = (0.5, 0.5, 0.5)
EXPERIMENT = Experiment(name="test")
SETTINGS = vetting_settings(EXPERIMENT)
INPUTS = tuple(Neuron("input", "Input", 0) for _ in range(6))
MOTOR = Neuron("output", "Simple", 1, (0.0, 0.5))
ROBOT = Robot(
    (Part("Core", -1, -1, -1, 0, GREY), Part("ActiveHinge", 0, 2, 0, 90, GREY)),
    Brain((*INPUTS, MOTOR)),
)


def request_for(robot: Robot, settings: bytes = SETTINGS) -> Request:
    """Return a request about a robot, its brain included."""
    return Request("run", 1, 1, Vet(BirthId(0, 7), 0, robot), settings)


def test_an_answer_is_the_report() -> None:
    space = body_space(EXPERIMENT.space)
    assert answer(request_for(ROBOT)) == analyze(ROBOT, space, EXPERIMENT.vetting)


@pytest.mark.parametrize(
    "brain",
    [Brain(), Brain((MOTOR, *INPUTS)), Brain((Neuron("output", "None", 7),))],
    ids=["none", "out of order", "of another body"],
)
def test_the_brain_of_a_request_is_ignored(brain: Brain) -> None:
    other = request_for(Robot(ROBOT.parts, brain))
    assert answer(other) == answer(request_for(ROBOT))


def test_a_brain_without_a_body_is_rejected() -> None:
    with pytest.raises(InvalidRobot, match="at least the core"):
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


def test_an_analyzer_does_no_other_work() -> None:
    work = Evaluate(BirthId(0, 7), ROBOT)
    with pytest.raises(MalformedMessage, match="vets bodies only"):
        answer(Request("run", 1, 1, work, SETTINGS))
