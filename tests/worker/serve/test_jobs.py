"""Requests, checks of their plug-ins, and their results."""

from collections.abc import Iterator

import pytest
from msgspec.structs import replace

import worker.measures
from schema.errors import (
    ExperimentError,
    InvalidRobot,
    MalformedMessage,
    RevolveError,
    UnknownPlugin,
)
from schema.experiment.document import Experiment, Measures, Simulation
from schema.experiment.file import read_experiment
from schema.experiment.settings import (
    evaluation_settings,
    evaluation_settings_of,
    read_evaluation_settings,
)
from schema.plugins import permission
from schema.robot.ids import NOBODY
from schema.robot.robot import Robot
from schema.wire.calls import call_settings, pack_value, unpack_value
from schema.wire.messages import (
    Breed,
    Call,
    CallValue,
    Evaluate,
    Failure,
    Request,
    Result,
    Work,
)
from worker.arena.world import World
from worker.kinds import checked
from worker.robot.evaluation import evaluate
from worker.serve.jobs import Jobs, call_function
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
    with pytest.raises(MalformedMessage, match="breeds no robots"):
        result_of(turtle, work=Breed(NOBODY, 0, 5))


def test_unknown_measure_is_refused() -> None:
    settings = replace(SETTINGS, measures=Measures(names=("height", "turnin")))
    with pytest.raises(ExperimentError, match=r"did you mean 'turning'\?"):
        checked(settings)


def test_faulty_measure_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(worker.measures.BUILT_IN, "faulty", lambda _trace: float("nan"))
    settings = replace(SETTINGS, measures=Measures(names=("height", "faulty")))
    with pytest.raises(ExperimentError, match=r"test_jobs.py:\d+: must return a fin"):
        checked(settings)


LAB = """
def double(value):
    return 2 * value

def odd(value):
    return object()

def broken(value):
    return 1 / value

def interrupted(value):
    raise KeyboardInterrupt

def ended(value):
    exit(3)

def two(first, second):
    return first
"""


@pytest.fixture(autouse=True, scope="module")
def lab(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    """Allow a module with functions."""
    file = tmp_path_factory.mktemp("lab") / "lab_of_calls.py"
    file.write_text(LAB)
    permission.allow([str(file)])
    yield
    del permission._allowed["lab_of_calls"]


def called(function: str, argument: object = 1) -> CallValue | Failure:
    return call_function(Call(pack_value(argument)), call_settings(function))


def value(function: str, argument: object) -> object:
    result = called(function, argument)
    assert isinstance(result, CallValue)
    return unpack_value(result.value)


def test_value_is_that_of_the_function() -> None:
    assert value("lab_of_calls:double", 21) == 42
    assert value("lab_of_calls:double", (1,)) == [1, 1]
    call = Call(pack_value("ab"))
    request = Request("run", 3, 17, call, call_settings("lab_of_calls:double"))
    assert Jobs(Shards(World)).answer(request) == CallValue(pack_value("abab"))


@pytest.mark.parametrize(
    ("name", "reason"),
    [
        ("broken", "raised ZeroDivisionError: division by zero"),
        ("interrupted", "raised KeyboardInterrupt"),
        ("ended", "raised SystemExit"),
        ("odd", ": its value must be None, bool"),
    ],
)
def test_error_of_the_function_is_a_failure(name: str, reason: str) -> None:
    failed = called(f"lab_of_calls:{name}", 0)
    assert isinstance(failed, Failure)
    assert failed.reason.replace(" :", ":").startswith(f"lab_of_calls:{name}")
    assert reason in failed.reason


@pytest.mark.parametrize(
    "function", ["os:getcwd", "shutil:rmtree", "schema.agent.flags:share"]
)
def test_modules_that_are_not_allowed_are_not_called(function: str) -> None:
    with pytest.raises(UnknownPlugin, match="is not allowed"):
        called(function)


def test_unfit_functions_and_requests_are_refused() -> None:
    with pytest.raises(UnknownPlugin, match="did you mean 'lab_of_calls:double'"):
        called("lab_of_calls:duble")
    with pytest.raises(RevolveError, match="must take 1 argument: "):
        called("lab_of_calls:two")
    with pytest.raises(MalformedMessage):
        call_function(Call(pack_value(1)), b"nothing")
    with pytest.raises(MalformedMessage):
        call_function(Call(b"\xc1"), call_settings("lab_of_calls:double"))
