"""Evaluation requests, the checks of their plug-ins, and their results."""

import msgspec
import pytest
from msgspec.structs import replace

import worker.measures
from schema.errors import ExperimentError, InvalidRobot, MalformedMessage
from schema.experiment.document import Experiment, Measures, Simulation
from schema.experiment.file import read_experiment
from schema.experiment.settings import (
    evaluation_settings,
    evaluation_settings_of,
    read_evaluation_settings,
)
from schema.robot.ids import NOBODY
from schema.robot.robot import Robot
from schema.wire.messages import Evaluate, Failure, Request, Result, Vet, Work
from worker.arena.world import World
from worker.robot.evaluation import evaluate
from worker.serve.checks import checked_evaluation
from worker.serve.jobs import Jobs
from worker.serve.shards import Shards

EXPERIMENT = Experiment(name="test", simulation=Simulation(window_steps=400))
SETTINGS = evaluation_settings_of(read_experiment("scenario1"))


def result_of(
    robot: Robot, experiment: Experiment = EXPERIMENT, work: Work | None = None
) -> Result:
    """Return the result of an evaluation, or of other work."""
    settings = evaluation_settings(experiment)
    request = Request("run", 3, 17, work or Evaluate(NOBODY, robot), settings)
    return Jobs(Shards(World)).answer(request)


def test_result_is_the_evaluation(turtle: Robot) -> None:
    settings = read_evaluation_settings(evaluation_settings(EXPERIMENT))
    assert result_of(turtle) == evaluate(turtle, settings)


def test_diverged_simulation_is_a_failure_with_the_reason(turtle: Robot) -> None:
    wild = replace(
        EXPERIMENT.simulation, timestep_s=0.5, servo_armature=0.0, servo_stiffness=1e9
    )
    result = result_of(turtle, replace(EXPERIMENT, simulation=wild))
    assert isinstance(result, Failure)
    assert result.reason.startswith("physics diverged by ")


def test_invalid_requests_are_rejected(turtle: Robot) -> None:
    with pytest.raises(InvalidRobot):
        result_of(Robot(turtle.parts))
    with pytest.raises(InvalidRobot, match="at least the core"):
        result_of(Robot((), turtle.brain))
    with pytest.raises(ExperimentError):
        Jobs(Shards(World)).answer(
            Request("run", 1, 1, Evaluate(NOBODY, turtle), b"{}")
        )
    with pytest.raises(MalformedMessage, match="vets no bodies"):
        result_of(turtle, work=Vet(NOBODY, 0, turtle))


def test_unknown_measure_is_refused() -> None:
    settings = replace(SETTINGS, measures=Measures(names=("height", "turnin")))
    with pytest.raises(ExperimentError, match=r"did you mean 'turning'\?"):
        checked_evaluation(msgspec.json.encode(settings))


def test_faulty_measure_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(worker.measures.BUILT_IN, "faulty", lambda _trace: float("nan"))
    settings = replace(SETTINGS, measures=Measures(names=("height", "faulty")))
    with pytest.raises(ExperimentError, match=r"test_jobs.py:\d+: must return a fin"):
        checked_evaluation(msgspec.json.encode(settings))
