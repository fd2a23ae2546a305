"""Evaluation requests and answers as bytes."""

import pytest
from msgspec.structs import replace

from schema.errors import ExperimentError, InvalidRobot, MalformedMessage
from schema.experiment.document import Experiment, Simulation
from schema.experiment.settings import evaluation_settings, read_evaluation_settings
from schema.robot.robot import Robot
from schema.wire.codec import decode_answer, encode_request
from schema.wire.protobuf import encode_robot
from worker.robot.evaluation import evaluate
from worker.serve.jobs import answer

EXPERIMENT = Experiment(name="test", simulation=Simulation(window_steps=400))


def request_for(robot: Robot, experiment: Experiment = EXPERIMENT) -> bytes:
    """Return the bytes of a request with number 17 of incarnation 3."""
    return encode_request(
        run="run",
        epoch=3,
        number=17,
        settings=evaluation_settings(experiment),
        robot=encode_robot(robot),
    )


def test_answer_has_the_evaluation_and_the_request_s_number(turtle: Robot) -> None:
    settings = read_evaluation_settings(evaluation_settings(EXPERIMENT))
    found = decode_answer(answer(request_for(turtle)))
    assert (found.epoch, found.number) == (3, 17)
    assert found.result == evaluate(turtle, settings)
    assert found.wall_s > 0


def test_diverged_simulation_is_answered_with_the_reason(turtle: Robot) -> None:
    wild = replace(
        EXPERIMENT.simulation, timestep_s=0.5, servo_armature=0.0, servo_stiffness=1e9
    )
    request = request_for(turtle, replace(EXPERIMENT, simulation=wild))
    found = decode_answer(answer(request))
    assert isinstance(found.result, str)
    assert found.result.startswith("physics diverged by ")


def test_invalid_requests_are_rejected(turtle: Robot) -> None:
    with pytest.raises(MalformedMessage):
        answer(b"no request")
    robot = Robot(turtle.parts)
    with pytest.raises(InvalidRobot):
        answer(request_for(robot))
    bad = encode_request(
        run="run", epoch=1, number=1, settings=b"{}", robot=encode_robot(turtle)
    )
    with pytest.raises(ExperimentError):
        answer(bad)
