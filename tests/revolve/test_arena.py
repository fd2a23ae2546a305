"""Mistakes of orders from Python, which no coordinator gets."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import revolve as rv
from revolve import arena as orders

ROBOT = rv.Robot((rv.Part("Core", -1, -1, -1, 0, ()),))
PLACE = "place: must be 2 finite numbers, x and y [m], got "
BIRTH = "birth: must be a whole number from 0 to 4294967295, got "


@pytest.fixture
def arena(monkeypatch: pytest.MonkeyPatch) -> rv.Arena:
    """Return an arena whose coordinator cannot be asked."""
    monkeypatch.setattr(orders, "coordinator_of", lambda _: ("a", "arena of a"))
    monkeypatch.setattr(orders, "send", pytest.fail)
    return rv.Arena("a")


@pytest.mark.parametrize(
    ("order", "line"),
    [
        (
            lambda arena: arena.insert("a.yaml"),
            "robot must be a Robot, got 'a.yaml': R",
        ),
        (lambda arena: arena.insert(ROBOT, 1.0), f"{PLACE}1.0"),
        (lambda arena: arena.insert(ROBOT, (1.0,)), f"{PLACE}(1.0,)"),
        (lambda arena: arena.insert(ROBOT, ("1", 2)), f"{PLACE}('1', 2)"),
        (lambda arena: arena.insert(ROBOT, (np.nan, 0.0)), f"{PLACE}(nan, 0.0)"),
        (
            lambda arena: arena.insert(ROBOT, parents=7),
            "parents: must be a list, or an",
        ),
        (
            lambda arena: arena.insert(ROBOT, parents={1, 2}),
            "parents: must be a list, ",
        ),
        (
            lambda arena: arena.insert(ROBOT, parents=(1, 2, 3)),
            "parents: must be at most 2 robots, got 3",
        ),
        (lambda arena: arena.insert(ROBOT, parents=(1, "2")), f"{BIRTH}'2'"),
        (lambda arena: arena.remove(-1), f"{BIRTH}-1"),
        (lambda arena: arena.remove("0:17"), f"{BIRTH}'0:17'"),
        (lambda arena: arena.replace_brain(3, None), "robot must be a Robot, got None"),
        (lambda _: rv.Arena("a", island=-1), "island: must be a whole number from 0"),
    ],
)
def test_mistakes_are_refused_here(
    arena: rv.Arena, order: Callable[[Any], object], line: str
) -> None:
    with pytest.raises(rv.RevolveError) as caught:
        order(arena)
    assert str(caught.value).startswith(line)
