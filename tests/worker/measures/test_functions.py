"""Measures by name, their parameters, and their contract."""

import msgspec
import numpy as np
import pytest

from schema.errors import ExperimentError, FitnessUndefined, UnknownPlugin
from schema.experiment.document import Fitness, Measures, Simulation, Space
from schema.experiment.settings import EvaluationSettings
from schema.plugins.permission import allow
from schema.plugins.simple_traces import simple_traces
from schema.robot.trace import Trace
from worker.fitness import TraceFunction
from worker.kinds import check_measures
from worker.measures.functions import BUILT_IN, functions_of, measures_of

OWN = """
from msgspec import Struct
from schema.plugins.needs import needs

class Limit(Struct):
    above_m: float = 0.25

@needs("contact")
def limp(trace):
    return 1.0 - float(trace.contact.mean())

def high(trace, limit: Limit):
    return float((trace.core_position[:, 2] > limit.above_m).mean())

def loose(trace, limit):
    return 0.0

nothing = 3
"""


@pytest.fixture(scope="module")
def own(tmp_path_factory: pytest.TempPathFactory) -> str:
    """Return the name of a module with measures of its own."""
    file = tmp_path_factory.mktemp("own") / "own_measures_of_a_test.py"
    file.write_text(OWN)
    allow([str(file)])
    return file.stem


@pytest.mark.parametrize("name", BUILT_IN)
def test_built_in_measures_keep_the_contract(name: str) -> None:
    check_measures(Measures(names=(name,)))


def test_own_measures_have_parameters(own: str) -> None:
    measures = Measures(
        names=(f"{own}:high", "height", f"{own}:limp"),
        parameters={"high": {"above_m": 0.5}},
    )
    trace = Trace(1.0, np.array([(0, 0, 0.4), (0, 0, 0.6)]), {"contact": np.eye(2)})
    assert measures.labels == ("high", "height", "limp")
    assert [each.value(trace) for each in measures_of(measures)] == [0.5, 0.5, 0.5]
    settings = EvaluationSettings(
        space=Space(), simulation=Simulation(), fitness=Fitness(), measures=measures
    )
    assert functions_of(settings).channels == ("contact",)
    assert functions_of(msgspec.structs.replace(settings)) is functions_of(settings)


@pytest.mark.parametrize(
    ("name", "parameters", "error", "message"),
    [
        ("hight", {}, UnknownPlugin, r"measures.names: .* did you mean 'height'\?"),
        ("{}:lipm", {}, UnknownPlugin, r"did you mean '\w+:limp'\?"),
        ("{}:nothing", {}, ExperimentError, "is not a function"),
        ("{}:loose", {}, ExperimentError, "must take 1 argument \\(trace\\), this"),
        ("{}:high", {"high": {"abov_m": 1}}, ExperimentError, "did you mean 'above_m'"),
        ("{}:high", {"high": {"above_m": "a"}}, ExperimentError, "must be a number"),
        ("height", {"height": {"a": 1}}, ExperimentError, "height has no parameters"),
    ],
)
def test_wrong_measures_are_refused(
    own: str, name: str, parameters: dict[str, dict[str, object]],
    error: type[Exception], message: str,
) -> None:  # fmt: skip
    measures = Measures(names=(name.format(own),), parameters=parameters)
    with pytest.raises(error, match=message):
        measures_of(measures)


def test_undefined_measures_are_failed_results() -> None:
    trace = simple_traces(lambda _trace: 0.0)["still"]
    with pytest.raises(FitnessUndefined, match="measure x raised ZeroDivisionError"):
        TraceFunction("measure x", lambda _trace: 1 / 0).value(trace)
    with pytest.raises(FitnessUndefined, match="measure x must return a finite number"):
        TraceFunction("measure x", lambda _trace: float("nan")).value(trace)
