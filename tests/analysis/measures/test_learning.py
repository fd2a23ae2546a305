"""Measures of lifetime learning, by hand."""

from collections.abc import Sequence
from typing import Any

import pyarrow as pa
import pytest

from analysis.figures import learning as figures
from analysis.figures.forms import NothingToDraw
from analysis.measures.learning import learning, learning_curves
from analysis.measures.outputs import run_schema
from analysis.measures.run_tables import RunTables
from tests.analysis.tables import births, population, run, table


def trials(*fitness: Sequence[float | None]) -> pa.Table:
    """Return the fitness of each trial of births 0, 1, 2 and so on, on island 1."""
    rows: list[dict[str, Any]] = [
        {"island": 1, "birth": birth, "trial": trial, "fitness": value}
        for birth, values in enumerate(fitness)
        for trial, value in enumerate(values)
    ]
    return table("learning", rows)


TABLES = RunTables(
    run(
        births=births(*(((1, number), []) for number in range(6))),
        population=population(
            (1, 2, {(1, 0): 1.0, (1, 1): 2.0}),
            (1, 5, {(1, 1): 2.0, (1, 2): 5.0, (1, 4): 3.0}),
        ),
        learning=trials(
            [0.5, 1.0, 0.2],
            [2.0, None, 1.5],
            [1.5, 4.0, 5.0],
            [None, None, -1.0],
            [2.5, 3.0, None],
        ),
    )
)
"""Founders 0 and 1; 3 is not kept; 2 was saved: 1.5 is below 2, the least."""


def test_gain_and_bodies_saved_by_hand() -> None:
    found = learning(TABLES)
    wanted = [
        (0, 3, 0.5, 1.0, 0.5, None, None),
        (1, 3, 2.0, 2.0, 0.0, None, None),
        (2, 3, 1.5, 5.0, 3.5, True, True),
        (3, 3, -1.0, -1.0, 0.0, False, False),
        (4, 3, 2.5, 3.0, 0.5, True, False),
    ]
    names = ("birth", "trials", "at_birth", "fitness", "gain", "kept", "saved")
    assert [tuple(row[name] for name in names) for row in found.to_pylist()] == wanted
    assert set(found["birth_island"].to_pylist()) == {1}
    assert found.select(run_schema("learning").names).cast(run_schema("learning"))


def test_learning_curves_by_hand() -> None:
    """After trial 1: 1, 2, 4, -1 (both failed) and 3."""
    found = learning_curves(TABLES).to_pylist()
    assert [row["robots"] for row in found] == [5, 5, 5]
    assert [row["median"] for row in found] == [1.5, 2.0, 2.0]
    assert [row["low"] for row in found] == [0.5, 1.0, 1.0]
    assert [row["high"] for row in found] == pytest.approx([2.0, 3.0, 3.0])


def test_bodies_saved_in_an_arena_by_hand() -> None:
    """0 and 2 are mature in two populations; at birth 0 was below all of the second.

    1 was culled, 3 moved away, and 4 is still an infant.
    """
    born = births(*(((1, n), []) for n in range(5)), sim_time_s=[0.0, 1.0, 2.0, 3, 4])
    living = population(
        (1, 2, {(1, 0): None, (1, 1): None}),
        (1, 3, {(1, 0): 3.0, (1, 1): 1.0, (1, 2): None, (1, 3): 9.0}),
        (1, 4, {(1, 0): 2.0, (1, 2): 4.0}),
        (1, 5, {(1, 0): 2.0, (1, 2): 4.0, (1, 4): None}),
        is_online=True,
    )
    went = ((1, "selection"), (3, "migrated"))
    deaths = [{"island": 1, "birth": birth, "reason": why} for birth, why in went]
    tables = run(births=born, population=living, deaths=table("deaths", deaths))
    tables["learning"] = trials(*([1.0 + number, 3.0] for number in range(5)))
    found = learning(RunTables(tables))
    assert found["kept"].to_pylist() == [True, False, True, None, None]
    assert found["saved"].to_pylist() == [True, False, False, None, None]


def test_a_run_without_trials_has_empty_tables() -> None:
    empty = RunTables(
        run(births=births(((1, 0), [])), population=population(), learning=trials())
    )
    assert learning(empty).num_rows == learning_curves(empty).num_rows == 0


def named(made: pa.Table, experiments: tuple[str, ...]) -> pa.Table:
    """Return measures of a run as those of several experiments."""
    return pa.concat_tables(
        made.append_column("experiment", pa.repeat(name, made.num_rows))
        for name in experiments
    )


def test_figures_are_drawn_without_a_warning() -> None:
    experiments = ("a", "b")
    robots = [
        {"birth": birth, "at_birth": 0.1 * birth, "fitness": 0.2 * birth,
         "kept": birth % 2 == 0, "saved": birth % 4 == 0}
        for birth in range(10, 30)
    ]  # fmt: skip
    tables = {
        "learning": named(pa.Table.from_pylist(robots), experiments),
        "learning_curves": named(learning_curves(TABLES), experiments),
    }
    for draw in (
        figures.learning_curves, figures.learning_gain, figures.bodies_saved
    ):  # fmt: skip
        axes = draw(tables).draw().axes
        assert len(axes) == (1 if draw is figures.learning_curves else len(experiments))


def test_founders_alone_have_no_bodies_saved() -> None:
    tables = {"learning": named(learning(TABLES).slice(0, 2), ("a",))}
    with pytest.raises(NothingToDraw, match="no robot that learns was born after the"):
        figures.bodies_saved(tables)


def test_one_point_is_no_line() -> None:
    tables = {
        "learning": named(learning(TABLES), ("a",)),
        "learning_curves": named(learning_curves(TABLES).slice(0, 1), ("a",)),
    }
    with pytest.raises(NothingToDraw, match="has births in two intervals of 10"):
        figures.learning_gain(tables)
    with pytest.raises(NothingToDraw, match="has two trials"):
        figures.learning_curves(tables)
