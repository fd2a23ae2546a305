"""The check of neuron types accepts the built-in ones and refuses broken ones."""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pytest

from schema.errors import ExperimentError
from schema.parts import Parameter
from schema.plugins.check_neuron_type import check_neuron_type
from schema.robot.neurons import BUILT_IN_NEURONS, StatelessNeuron, Tick
from schema.robot.results import Floats

KEY = "space.neuron_types"


def plain(inputs: Floats, parameters: Floats, tick: Tick) -> Floats:
    del parameters, tick
    return inputs


PLAIN = StatelessNeuron("Plain", (), plain)


@pytest.mark.parametrize("kind", BUILT_IN_NEURONS.values(), ids=lambda kind: kind.name)
def test_built_in_types_pass(kind: StatelessNeuron) -> None:
    check_neuron_type(kind, KEY)


def test_a_type_without_parameters_passes() -> None:
    check_neuron_type(PLAIN, KEY)


def coupled(inputs: Floats, parameters: Floats, tick: Tick) -> Floats:
    del parameters, tick
    output: Floats = inputs - inputs.mean()
    return output


def writing(inputs: Floats, parameters: Floats, tick: Tick) -> Floats:
    del parameters, tick
    inputs += 1.0
    return inputs


def raising(inputs: Floats, parameters: Floats, tick: Tick) -> Floats:
    del parameters, tick
    raise ArithmeticError(f"{len(inputs)} is too much")


@dataclass
class Counting:
    """Output that counts the calls."""

    calls: int = 0

    def __call__(self, inputs: Floats, parameters: Floats, tick: Tick) -> Floats:
        del parameters, tick
        self.calls += 1
        return inputs + self.calls


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"name": "two words"}, "a name that is an identifier"),
        ({"name": "Input"}, "a name that is an identifier"),
        ({"parameters": ("gain",)}, "parameters as a tuple of Parameter"),
        ({"parameters": (Parameter("a", 1.0, 0.0, 0.5),)}, "low <= default <= high"),
        ({"parameters": (Parameter("a", 0.0, 1.0, 2.0),)}, "low <= default <= high"),
        ({"parameters": (Parameter("a", 0.0, 1.0, 0.5),) * 33}, "<= 32 parameters"),
        ({"states": 0}, r"states in 1\.\.16, got 0"),
        ({"states": 2}, "ValueError: cannot reshape"),
        ({"output": coupled}, "got other ones in a smaller batch"),
        ({"output": Counting()}, "got other ones in a second time"),
        ({"output": writing}, "step to change no argument"),
        ({"output": raising}, "got ArithmeticError: 101 is too much"),
        ({"output": lambda *_: np.full(101, np.nan)}, "expected finite states"),
    ],
)
def test_a_broken_type_is_refused_with_its_place(
    changes: dict[str, Any], message: str
) -> None:
    with pytest.raises(ExperimentError, match=message) as caught:
        check_neuron_type(replace(PLAIN, **changes), KEY)
    assert str(caught.value).startswith(f"{KEY}: neurons.py:")
    assert "\n" not in str(caught.value)
