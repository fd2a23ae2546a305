"""Loss and recovery at the points of changing settings."""

from typing import Any

import pytest

from analysis.measures.run_tables import RunTables
from analysis.measures.season_changes import season_changes
from tests.analysis.tables import Name, births, population, table
from tests.documents import parse

CHANGE = """
[[changes]]
setting = "simulation.friction"
at = [0, 20, 50]
values = [1.0, 0.3, 1.0]
"""
ARENA = "[simulation]\nwarmup_steps = 600\n[arena]\n" + CHANGE
COLUMNS = ("births", "point", "before", "after", "lost", "recovery")


def measured(run: RunTables) -> list[tuple[Any, ...]]:
    return [tuple(map(row.get, COLUMNS)) for row in season_changes(run).to_pylist()]


def test_loss_and_recovery_of_an_island_by_hand() -> None:
    """From 0.8 to 0.5 at 20 births, back at 40; 0.9 after 50 births is no loss."""
    course = {10: 0.7, 20: 0.8, 30: 0.5, 40: 0.8, 50: 0.85, 60: 0.9}
    levels: list[tuple[int, int, dict[Name, float | None]]] = [
        (0, number, {(0, 0): fitness}) for number, fitness in course.items()
    ]
    tables = {"births": births(((0, 0), [])), "population": population(*levels)}
    found = measured(RunTables(tables, islands=[parse(CHANGE)]))
    assert found == [
        (20, 20, 0.8, 0.5, pytest.approx(0.3), 20),
        (50, 50, 0.85, 0.9, pytest.approx(-0.05), 10),
    ]


def test_an_arena_is_measured_a_window_later_and_may_never_recover() -> None:
    """The window is 12 s: the first sample is at 35 s; immature robots do not count."""
    course = {15.0: 0.6, 20.0: 0.8, 25.0: 0.7, 35.0: 0.4, 50.0: 0.5, 70.0: 0.9}
    samples = [
        {"sim_time_s": s, "fitness": f if ok else 9.0, "is_mature": ok}
        for s, f in course.items()
        for ok in (True, False)
    ]
    born = births(((0, 0), []), ((0, 1), []), sim_time_s=[1.0, 21.0])
    tables = {"births": born, "fitness": table("fitness", samples)}
    found = measured(RunTables(tables, islands=[parse(ARENA)]))
    assert found == [
        (1, 20, 0.8, 0.4, pytest.approx(0.4), None),
        (2, 50, 0.5, 0.9, pytest.approx(-0.4), 20),
    ]
