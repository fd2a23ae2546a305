"""Fitness under changes: shares and the line about a run, by hand."""

from typing import Any

import plotnine as p9
import pytest

from analysis.comparison.robustness import COLUMNS, Row, kept, summary, table_of
from analysis.figures.changes import robustness
from analysis.figures.forms import NothingToDraw


def row(
    birth: int, group: str, fitness: float | None, undisturbed: float | None = 0.1,
    **rest: Any,  # noqa: ANN401 - of any column
) -> Row:  # fmt: skip
    return {
        "experiment": "a", "folder": "runs/a", "island": 0, "birth": birth,
        "is_best": birth == 7, "is_last": True, "recorded": 0.1,
        "undisturbed": undisturbed, "group": group, "change": f"{group} changed",
        "fitness": fitness, "failure": "" if fitness is not None else "diverged",
    } | rest  # fmt: skip


ROWS = [
    row(7, "start", 0.1), row(7, "start", 0.06), row(7, "friction", 0.04),
    row(8, "start", 0.05, 0.05), row(8, "start", None, 0.05),
    row(8, "friction", 0.06, 0.05),
    row(9, "start", 0.0, 0.0), row(9, "start", 0.01, 0.0),
    row(9, "friction", 0.02, 0.0),
]  # fmt: skip


def test_shares_are_of_the_fitness_without_changes() -> None:
    table = table_of(ROWS, COLUMNS)
    assert table.schema.names == [*COLUMNS]
    assert all(field.metadata[b"meaning"] for field in table.schema)
    shares = table["share"].to_pylist()
    assert shares[:4] == pytest.approx([1.0, 0.6, 0.4, 1.0])
    assert shares[4] is None
    assert shares[5] == pytest.approx(1.2)
    assert shares[6:] == [None, None, None]


def test_groups_count_equally() -> None:
    rows = table_of(ROWS, COLUMNS).to_pylist()
    assert kept(rows[:3]) == pytest.approx((0.8 + 0.4) / 2)
    assert kept(rows[3:6]) == pytest.approx((1.0 + 1.2) / 2)
    assert kept(rows[6:]) is None


def test_line_about_a_run() -> None:
    assert summary(table_of(ROWS, COLUMNS)) == (
        "the best ever, 0:7, keeps 60 % of its fitness (0.1000) on average, from 40 % "
        "under friction changed to 100 % under start changed; the last population of 3 "
        "keeps 85 % in the median, 60 % to 110 %; 1 of 9 evaluations failed"
    )
    failed = [row(7, "start", None, None, is_last=False)]
    assert summary(table_of(failed, COLUMNS)) == (
        "the best ever, 0:7, has no fitness without changes; 1 of 1 evaluations failed"
    )
    still = [row(7, "start", 0.1, -0.2)]
    assert summary(table_of(still, COLUMNS)) == (
        "the best ever, 0:7, has a fitness of -0.2000 without changes"
    )


def test_figure_has_a_point_for_each_share() -> None:
    rows = [*ROWS, row(7, "start", 0.09, change="start 0.1 mm higher")]
    last, best = (
        sorted(layer._data["share"])
        for layer in robustness(table_of(rows, COLUMNS)).layers
        if isinstance(layer.geom, p9.geom_point)
    )
    assert last == pytest.approx([0.4, 0.6, 0.9, 1.0, 1.0, 1.2])
    assert best == pytest.approx([0.4, 0.6, 0.9, 1.0])
    with pytest.raises(NothingToDraw, match="positive fitness"):
        robustness(table_of(ROWS[6:], COLUMNS))
