"""Declared channels, and what a trace says about the others."""

import numpy as np
import pytest

from schema.errors import ExperimentError
from schema.plugins.needs import channels_of, needs
from schema.robot.trace import Trace


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
