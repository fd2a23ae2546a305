"""Measures: values of the built-in ones by hand, names, parameters, contract."""

from collections.abc import Callable
from typing import Any

import msgspec
import numpy as np
import pytest

from schema.errors import ExperimentError, FitnessUndefined, UnknownPlugin
from schema.experiment.document import Measures, Simulation
from schema.plugins.simple_traces import simple_traces
from schema.robot.robot import Part, Robot
from schema.robot.trace import Trace
from tests.worker.evaluations import with_simulation
from worker.fitness import TraceFunction
from worker.kinds import check_measures
from worker.measures import BUILT_IN, functions_of, measures_of


def value(name: str, trace: Trace) -> float:
    (found,) = measures_of(Measures(names=(name,)))
    return found.value(trace)


def trace(*points: tuple[float, float, float], **channels: Any) -> Trace:  # noqa: ANN401
    """Return a trace through some points, a second apart."""
    return Trace(1.0, np.array(points, dtype=float), channels)


def standing(count: int, **channels: Any) -> Trace:  # noqa: ANN401
    return trace(*[(0.0, 0.0, 0.1)] * count, **channels)


def about_z(*degrees: float) -> np.ndarray[Any, Any]:
    half = np.radians(degrees) / 2
    zero = np.zeros(len(degrees))
    return np.stack([np.cos(half), zero, zero, np.sin(half)], axis=1)


ROLL = np.array([(1.0, 0, 0, 0), (np.sqrt(0.5), np.sqrt(0.5), 0, 0)])


@pytest.mark.parametrize(
    ("attitudes", "degrees"),
    [
        # 30 degrees left and 60 right in 2 s.
        (about_z(0, 30, -30), 45),
        # The shorter way across 180 degrees.
        (about_z(170, -170), 20),
        (ROLL, 0),
    ],
)
def test_turning_adds_turns_to_both_sides(
    attitudes: np.ndarray[Any, Any], degrees: float
) -> None:
    found = standing(len(attitudes), core_attitude=attitudes)
    assert value("turning", found) == pytest.approx(np.radians(degrees))


def test_energy_is_that_at_the_end() -> None:
    assert value("energy", standing(3, energy=np.array([0.0, 1.5, 2.5]))) == 2.5


def test_cost_of_transport_of_2_kg_over_5_metres() -> None:
    """98.1 J for 2 kg over 5 m: 98.1 / (2 * 9.81 * 5) = 1."""
    found = trace(
        (0, 0, 0.2), (3, 4, 0.1), energy=np.array([0, 98.1]), mass=2.0, gravity=9.81
    )
    assert value("cost_of_transport", found) == pytest.approx(1.0)


def test_cost_of_transport_of_a_still_robot_is_that_of_a_millimetre() -> None:
    found = standing(2, energy=np.array([0, 9.81]), mass=1.0, gravity=9.81)
    assert value("cost_of_transport", found) == pytest.approx(1000.0)


def test_height_is_the_mean() -> None:
    assert value("height", trace((0, 0, 0.1), (1, 0, 0.3), (1, 5, 0.2))) == (
        pytest.approx(0.2)
    )


def part(kind: str) -> Part:
    return Part(kind, 0, 0, 0, 0, (), 0)


@pytest.mark.parametrize(
    ("kinds", "places", "share"),
    [
        ("C", [(0, 0, 0)], 1.0),
        # Both arms have a mirror image in the plane of x and z.
        ("CBB", [(0, 0, 0), (0, 0.1, 0), (0, -0.1, 0)], 1.0),
        # Of an arm along x and one along y, one is on its plane in either case.
        ("CBB", [(0, 0, 0), (0.1, 0, 0), (0, 0.1, 0)], 2 / 3),
        # Opposite parts of different kinds; both planes leave the core and nothing
        # else, or the whole line.
        ("CBH", [(0, 0, 0), (0.1, 0.1, 0), (-0.1, 0.1, 0)], 1 / 3),
        ("CBB", [(0, 0, 0), (0.1, 0.1, 0), (-0.1, 0.1, 0)], 1.0),
        # 2 cm from the mirrored place is too far, 5 mm is not.
        ("CBB", [(0, 0, 0), (0.1, 0.1, 0), (-0.1, 0.12, 0)], 1 / 3),
        ("CBB", [(0, 0, 0), (0.1, 0.1, 0), (-0.1, 0.105, 0)], 1.0),
    ],
)
def test_body_symmetry(
    kinds: str, places: list[tuple[float, float, float]], share: float
) -> None:
    robot = Robot(tuple(part(kind) for kind in kinds))
    found = standing(2, part_position=np.array(places), robot=robot)
    assert value("body_symmetry", found) == pytest.approx(share)


def test_joint_effort_is_the_mean_of_absolute_torques() -> None:
    torque = np.array([(1.0, -3.0), (0.0, 2.0)])
    assert value("joint_effort", standing(2, joint_torque=torque)) == 1.5
    assert value("joint_effort", standing(2, joint_torque=np.zeros((2, 0)))) == 0.0


def test_contact_share_counts_parts_and_samples() -> None:
    contact = np.array([(True, False, False, False), (True, True, False, False)])
    assert value("contact_share", standing(2, contact=contact)) == 0.375


def test_every_built_in_measure_names_its_unit() -> None:
    for name, function in BUILT_IN.items():
        text = function.__doc__ or ""
        assert "[" in text.splitlines()[0], name


# --- names, parameters, contract ----------------------------------------------

OWN = """
from msgspec import Struct
from schema.robot.trace import needs

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


@pytest.fixture
def own(own_module: Callable[[str], str]) -> str:
    """Return the name of a module with measures of its own."""
    return own_module(OWN)


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
    settings = with_simulation(Simulation(), measures=measures)
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
