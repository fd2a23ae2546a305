"""Invariants of the state machines after each test."""

from collections.abc import Callable, Iterator
from typing import Any

import pytest

from tests.coordinator.invariants import CHECKS


@pytest.fixture(autouse=True)
def _invariants(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """Check each state machine that a test made, once it is over."""
    made: list[Any] = []

    def noting(kind: type[Any]) -> Callable[..., None]:
        begin = kind.__init__

        def begin_noted(machine: Any, *args: Any, **options: Any) -> None:  # noqa: ANN401
            begin(machine, *args, **options)
            made.append(machine)

        return begin_noted

    for kind in CHECKS:
        monkeypatch.setattr(kind, "__init__", noting(kind))
    yield
    for machine in made:
        CHECKS[type(machine)](machine)
