"""Calls of plug-ins with sample inputs."""

from collections.abc import Callable
from itertools import count
from math import nan
from typing import Any

import numpy as np
import pytest

from schema.errors import ExperimentError
from schema.parts import Box
from schema.plugins.contract import broken, repeated

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
