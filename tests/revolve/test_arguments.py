"""Arguments of the Python API."""

import sys

import numpy as np
import pytest

from revolve.arguments import is_silent, whole_number
from schema.errors import RevolveError


@pytest.mark.parametrize("value", [0, 7, np.int64(3)])
def test_whole_numbers_in_the_range_are_taken(value: int) -> None:
    assert whole_number("seed", value, most=7) == value


@pytest.mark.parametrize("value", [-1, 8, 2.5, True, "3", None])
def test_anything_else_is_refused_with_the_range(value: object) -> None:
    expected = rf"^seed: must be a whole number from 0 to 7, got '?{value}'?$"
    with pytest.raises(RevolveError, match=expected):
        whole_number("seed", value, most=7)


@pytest.mark.parametrize("progress", [True, False])
def test_progress_is_shown_in_notebooks_unless_told_otherwise(
    *, progress: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delitem(sys.modules, "ipykernel", raising=False)
    assert is_silent(progress=None)
    monkeypatch.setitem(sys.modules, "ipykernel", sys)
    assert not is_silent(progress=None)
    assert is_silent(progress=progress) != progress
