"""Tests of the figures of single robots."""

import pytest

from analysis.figures.forms import NothingToDraw, Tables
from analysis.figures.robots import variability
from tests.analysis.drawn import layers, table


def measured(*robots: tuple[str, str, float]) -> Tables:
    """Return the table of robots: experiment, folder and variability of each."""
    rows = [
        {"experiment": experiment, "folder": folder, "variability": value}
        for experiment, folder, value in robots
    ]
    return {"variability": table("variability", rows)}


def test_density_and_lines_are_those_of_robots_that_differ() -> None:
    figure = variability(
        measured(
            ("a", "a-0", 0.2), ("a", "a-0", 0.4), ("a", "a-1", 0.5),
            ("b", "b-0", 0.3), ("b", "b-1", 0.6),
            ("c", "c-0", 0.7), ("d", "d-0", 1.0), ("d", "d-0", 1.0),
        )
    )  # fmt: skip
    shown = layers(figure)
    assert shown["geom_density"]["variability"] == [0.2, 0.4, 0.5, 0.3, 0.6]
    assert shown["geom_line"]["folder"] == ["a-0", "a-0"]
    figure.draw()


@pytest.mark.parametrize("other", [("b", "b-0", 0.4), ("a", "a-1", 0.2)])
def test_robots_that_do_not_differ_have_no_density(
    other: tuple[str, str, float],
) -> None:
    """One robot of each of two experiments, or two equal ones of one."""
    with pytest.raises(NothingToDraw, match="no two robots of an experiment differ"):
        variability(measured(("a", "a-0", 0.2), other))
