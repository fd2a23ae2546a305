"""The check of neuron types accepts the built-in ones and refuses broken ones."""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pytest

from schema.errors import ExperimentError
from schema.parts import Parameter
from schema.plugins.check_neuron_type import check_neuron_type
from schema.robot.neurons import BUILT_IN_NEURONS, StatelessNeuron, Tick
from schema.robot.trace import Floats


def plain(inputs: Floats, parameters: Floats, tick: Tick) -> Floats:
    del parameters, tick
    return inputs


PLAIN = StatelessNeuron("Plain", (), plain)


@pytest.mark.parametrize("kind", BUILT_IN_NEURONS.values(), ids=lambda kind: kind.name)
def test_built_in_types_pass(kind: StatelessNeuron) -> None:
    check_neuron_type(kind)


def test_a_type_without_parameters_passes() -> None:
    check_neuron_type(PLAIN)


def coupled(inputs: Floats, parameters: Floats, tick: Tick) -> Floats:
    del parameters, tick
    output: Floats = inputs - inputs.mean()
    return output


def writing(inputs: Floats, parameters: Floats, tick: Tick) -> Floats:
    del parameters, tick
    inputs += 1.0
    return inputs


@dataclass
class Counting:
    """Output that counts the calls."""

    calls: int = 0

    def __call__(self, inputs: Floats, parameters: Floats, tick: Tick) -> Floats:
        del parameters, tick
        self.calls += 1
        return inputs + self.calls


WORSE = Parameter("a", 1.0, 0.0, 0.5)
BEYOND = Parameter("a", 0.0, 1.0, 2.0)
GAIN = Parameter("a", 0.0, 1.0, 0.5)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"name": "two words"}, "name: must be an identifier"),
        ({"name": "Input"}, "name: must be an identifier"),
        ({"parameters": ("gain",)}, "parameters: must be a tuple of Parameter"),
        ({"parameters": (WORSE,)}, r"low <= default <= high, got \(1.0, 0.5, 0.0\)"),
        ({"parameters": (BEYOND,)}, "low <= default <= high"),
        ({"parameters": (GAIN,) * 33}, "must be <= 32 parameters, got 33"),
        ({"states": 0}, r"states: must be in 1\.\.16, got 0"),
        ({"output": coupled}, "got other ones in a smaller batch"),
        ({"output": Counting()}, "must return the same twice"),
        ({"output": writing}, "step: must not write to its arguments"),
        ({"output": lambda *_: np.full(101, np.nan)}, "must return finite states"),
        ({"output": lambda *_: np.ones(101, np.float32)}, "got float32 of shape"),
    ],
)
def test_a_broken_type_is_refused(changes: dict[str, Any], message: str) -> None:
    with pytest.raises(ExperimentError, match=message):
        check_neuron_type(replace(PLAIN, **changes))
