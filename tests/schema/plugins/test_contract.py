"""Contracts of plug-ins, and of neuron types."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from itertools import count
from math import nan
from typing import Any

import numpy as np
import pytest

from schema.errors import ExperimentError
from schema.parts import Box, Parameter
from schema.plugins.check_neuron_type import check_neuron_type
from schema.plugins.contract import broken, repeated
from schema.robot.neurons import BUILT_IN_NEURONS, StatelessNeuron, Tick
from schema.robot.trace import Floats

NUMBERS, ARRAY, LIST = count(), np.zeros(3), [1.0]


def buffer() -> Any:  # noqa: ANN401
    """Return an array that the next call overwrites."""
    ARRAY[0] = next(NUMBERS)
    return ARRAY


@pytest.mark.parametrize(
    "call",
    [
        lambda: (1.0, nan),
        lambda: {"a": [nan, np.array([nan])]},
        lambda: Box("a", (nan, 1.0, 1.0), (0.0, 0.0, 0.0), 1.0),
        lambda: LIST,
    ],
)
def test_equal_answers_pass_also_if_they_are_not_numbers(
    call: Callable[[], object],
) -> None:
    assert repr(repeated("", call)) == repr(call())


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: next(NUMBERS), r"^step: must return the same twice, got \d+ and \d+$"),
        (buffer, "must return the same twice"),
        (lambda: np.ones(2, [float, int][next(NUMBERS) % 2]), "the same twice"),
        (lambda: LIST.append(1.0), "^step: must not write to its arguments"),
    ],
)
def test_other_answers_and_changed_arguments_are_refused(
    call: Callable[[], object], message: str
) -> None:
    with pytest.raises(ExperimentError, match=message):
        repeated("step", call, (LIST,))


def test_an_error_says_what_must_be_and_what_came() -> None:
    assert str(broken("", "be a text", 3)) == "must be a text, got 3"
    story = "name: must be a text, got none"
    assert str(broken("name", "be a text", came="none")) == story


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
