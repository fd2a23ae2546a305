"""Parameters of plug-ins are read as the plug-in's own Struct."""

from typing import Annotated, Any

import pytest
from msgspec import Meta, Struct, field

from schema.errors import ExperimentError
from schema.experiment.section import Parameters, PluginSection
from schema.plugins.parameters import read_parameters


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
