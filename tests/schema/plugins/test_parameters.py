"""What plug-ins declare: parameters, and channels of a trace; their state."""

from collections.abc import Callable
from types import ModuleType
from typing import Annotated, Any

import numpy as np
import pytest
from msgspec import Meta, Struct, field

from schema.errors import ExperimentError
from schema.experiment.section import Parameters, PluginSection
from schema.plugins.load import load_module
from schema.plugins.parameters import read_parameters
from schema.plugins.state import own_modules, unchanged
from schema.robot.trace import Trace, channels_of, needs


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


LAB = """
from collections import Counter, deque
from functools import cache, partial

import numpy as np
from msgspec import Struct


class Note(Struct):
    text: str = ""


class Slotted:
    __slots__ = ("inner",)


def counted(seen=[]):
    pass


def made(kept):
    return lambda: kept


@cache
def square(number):
    return number * number


TABLE, QUEUE, COUNTS, NAMES = np.zeros((2, 2)), deque([1]), Counter(), {1, 2}
MIXED = np.array([[1], None], dtype=object)
NOTE, SLOTTED, MADE = Note(), Slotted(), made([])
SLOTTED.inner = {"deep": [(1, [2])]}
RING = [NAMES]
RING.append(RING)
"""


@pytest.fixture
def lab(own_module: Callable[[str], str]) -> ModuleType:
    return load_module(own_module(LAB), "test")


@pytest.mark.parametrize(
    ("action", "changed"),
    [
        ("lab.TABLE[1, 1] = 2.0", "TABLE"),
        ("lab.QUEUE.append(2)", "QUEUE"),
        ("lab.COUNTS['a'] += 1", "COUNTS"),
        ("lab.NAMES.add(3)", "NAMES"),
        ("lab.MIXED[0].append(2)", "MIXED"),
        ("lab.NOTE.text = 'later'", "NOTE"),
        ("lab.SLOTTED.inner['deep'][0][1].append(3)", "SLOTTED"),
        ("lab.counted.__defaults__[0].append(1)", "counted"),
        ("lab.MADE.__closure__[0].cell_contents.append(1)", "MADE"),
        ("lab.RING.append(1)", "RING"),
        ("lab.Slotted.shared = 1", "Slotted"),
        ("lab.NEW = 1", "NEW"),
        ("del lab.NOTE", "NOTE"),
        ("lab.TABLE = lab.TABLE + 0.0", ""),
        ("lab.square(3)", ""),
        ("lab.NOTE = lab.Note()", ""),
        ("lab.NAMES.add(2)", ""),
    ],
)
def test_change_of_content_is_named(lab: ModuleType, action: str, changed: str) -> None:
    modules = own_modules()
    assert lab.__name__ in modules
    assert not {"numpy", "schema.parts", "random"} & {*modules}
    fault = ""
    try:
        with unchanged("stay", modules):
            exec(action, {"lab": lab})  # noqa: S102 - what a plug-in may do
    except ExperimentError as error:
        fault = str(error)
    expected = f"must stay, but changes {lab.__name__}.{changed}"
    assert fault == (expected if changed else "")
