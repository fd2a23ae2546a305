"""What plug-ins declare: parameters, and channels of a trace."""

from typing import Annotated, Any

import numpy as np
import pytest
from msgspec import Meta, Struct, field

from schema.errors import ExperimentError
from schema.experiment.section import Parameters, PluginSection
from schema.plugins.needs import channels_of, needs
from schema.plugins.parameters import read_parameters
from schema.robot.trace import Trace


class Wheel(Struct, frozen=True):
    radius: Annotated[float, Meta(gt=0)]
    spokes: int = 8


def test_defaults_complete_the_table() -> None:
    assert read_parameters({"radius": 0.5}, Wheel, "w") == Wheel(0.5, 8)


@pytest.mark.parametrize(
    ("table", "message"),
    [
        ({"radius": 1.0, "spoke": 3}, "w.spoke: no such key; did you mean 'spokes'?"),
        ({}, "w: must have a key 'radius'"),
        ({"radius": -1.0}, "w.radius: must be a number > 0.0"),
        ({"radius": "x"}, "w.radius: must be a number, got 'x'"),
        ({"radius": float("nan")}, "w.radius: must be finite"),
        ({"radius": 1.0, "spokes": [0, {"a": float("inf")}]}, "w.spokes[1].a: must be"),
    ],
)
def test_wrong_parameters_are_named(table: dict[str, Any], message: str) -> None:
    with pytest.raises(ExperimentError) as caught:
        read_parameters(table, Wheel, "w")
    assert str(caught.value).startswith(message)


def test_sections_with_parameters_are_hashable() -> None:
    class Judge(PluginSection, frozen=True):
        function: str = "f"
        parameters: Parameters = field(default_factory=dict)

    one, other = Judge(parameters={"a": 1, "b": 2}), Judge(parameters={"b": 2, "a": 1})
    assert one == other
    assert hash(one) == hash(other)
    assert len({one, other, Judge()}) == 2


@needs("energy", "core_attitude", "light")
def first(_trace: Trace) -> float:
    return 0.0


@needs("contact", "energy")
def second(_trace: Trace) -> float:
    return 0.0


def test_needs_of_several_functions_are_joined_in_the_order_of_the_channels() -> None:
    plain = channels_of([lambda _trace: 0.0])
    assert (plain, channels_of([])) == ((), ())
    assert channels_of([second, first]) == ("core_attitude", "energy", "contact")
    assert channels_of([first]) == ("core_attitude", "energy")
    assert channels_of([first], ("outputs", "light")) == (
        *channels_of([first]),
        "outputs",
    )
    posed = ("core_attitude", "joint_angle", "part_poses")
    assert channels_of([needs("part_poses")(lambda _trace: 0.0)]) == posed


def test_unknown_channel_is_refused_with_the_nearest_one() -> None:
    with pytest.raises(ExperimentError, match=r"'enrgy' is not a channel; did you"):
        needs("enrgy")


def test_undeclared_channel_is_an_error_that_says_how_to_declare_it() -> None:
    trace = Trace(0.2, np.zeros((3, 3)), {"energy": np.arange(3.0)})
    assert trace.energy.tolist() == [0.0, 1.0, 2.0]
    assert trace.duration_s == pytest.approx(0.4)
    with pytest.raises(ExperimentError, match=r'declare it with @needs\("contact"\)'):
        _ = trace.contact
