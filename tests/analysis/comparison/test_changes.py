"""Fitness under changes of body, brain and world: shares and lines, by hand."""

from typing import Any

import plotnine as p9
import pytest

from analysis.comparison import ablation, robustness
from analysis.comparison.ablation import shares
from analysis.comparison.robustness import Row, kept, table_of
from analysis.figures import changes
from analysis.figures.forms import NothingToDraw

HELD, MEAN, DEAD, RANDOM = (
    "input at 0", "input at its mean", "motor dead", "random brain"
)  # fmt: skip


def changed(
    birth: int,
    group: str,
    fitness: float | None,
    undisturbed: float | None = 0.1,
    **rest: Any,  # noqa: ANN401 - of any column
) -> Row:
    """Return a row about a robot; number 7 is the best ever."""
    return {
        "experiment": "a", "folder": "runs/a", "island": 0, "birth": birth,
        "is_best": birth == 7, "is_last": True, "recorded": 0.1,
        "undisturbed": undisturbed, "group": group, "change": f"{group} changed",
        "fitness": fitness, "failure": "" if fitness is not None else "diverged",
    } | rest  # fmt: skip


def row(
    birth: int, group: str, scope: str, fitness: float | None, kind: str = "",
    **rest: Any,  # noqa: ANN401 - of any column
) -> Row:  # fmt: skip
    """Return a row of an ablation."""
    is_one = scope == "one"
    more = {"is_last": birth != 7, "scope": scope, "kind": kind,
            "part": 4 if is_one else None, "channel": 0 if is_one else None,
            "change": "motor of part 4"}  # fmt: skip
    return changed(birth, group, fitness) | more | rest


ABLATED = [
    row(7, HELD, "one", 0.01, "touch"),
    row(7, HELD, "kind", 0.096, "touch"),
    row(7, HELD, "kind", 0.05, "imu"),
    row(7, HELD, "all", 0.04),
    row(7, MEAN, "all", 0.08),
    row(7, DEAD, "one", 0.059, "ActiveHinge"),
    row(7, DEAD, "one", None, "ActiveHinge", channel=1, change="motor of part 6"),
    row(7, DEAD, "one", 0.1, "ActiveHinge", channel=2, change="motor of part 8"),
    row(7, DEAD, "all", 0.0),
    row(7, RANDOM, "one", 0.01),
    row(7, RANDOM, "one", 0.02),
    row(7, RANDOM, "one", 0.09),
    row(8, HELD, "all", 0.1),
    row(8, DEAD, "one", 0.02, "ActiveHinge"),
    row(8, DEAD, "one", 0.07, "ActiveHinge"),
    row(8, RANDOM, "one", 0.03),
    row(9, HELD, "all", 0.05),
    row(9, DEAD, "one", 0.06, "ActiveHinge"),
]


def test_shares_by_group_scope_and_kind() -> None:
    table = table_of(ABLATED, ablation.COLUMNS)
    rows = table.to_pylist()
    assert rows[6]["share"] is None
    assert shares(rows[:12], HELD, "kind", "touch") == pytest.approx([0.96])
    assert shares(rows[:12], HELD, "kind") == pytest.approx([0.96, 0.5])
    assert shares(rows[:12], DEAD, "one") == pytest.approx([0.59, 1.0])


def test_line_about_an_ablated_run() -> None:
    assert ablation.summary(table_of(ABLATED, ablation.COLUMNS)) == (
        "the best ever, 0:7 (fitness 0.1000), keeps 96 % without touch, 50 % without "
        "imu, 40 % without sensors, 80 % with sensors at their mean, 20 % with a "
        "random brain; the motor of part 4 carries 41 %, the motor of part 8 carries "
        "0 %; 2 of the last population keep 75 % without sensors, 40 % without their "
        "most important motor, 30 % with a random brain in the median; "
        "1 of 18 evaluations failed"
    )
    arena = [row(7, HELD, "all", 0.1, recorded=0.3)]
    assert ablation.summary(table_of(arena, ablation.COLUMNS)) == (
        "the best ever, 0:7 (fitness 0.1000 alone, 0.3000 recorded), keeps 100 % "
        "without sensors"
    )


def test_figure_orders_motors_by_what_robots_lose() -> None:
    figure = changes.ablation(table_of(ABLATED, ablation.COLUMNS))
    assert figure.scales[1].limits == [
        "random brains", "all motors dead", "2nd motor dead",
        "most important motor dead", "all sensors at mean", "all sensors at 0",
        "touch at 0", "imu at 0",
    ]  # fmt: skip
    points = [
        layer._data for layer in figure.layers if isinstance(layer.geom, p9.geom_point)
    ]
    for last_or_best, first, second in zip(
        points, ([0.2, 0.6], [0.59]), ([0.7], [1.0]), strict=True
    ):
        for label, wanted in (
            ("most important motor dead", first), ("2nd motor dead", second)
        ):  # fmt: skip
            chosen = last_or_best[last_or_best["label"] == label]
            assert sorted(chosen["share"]) == pytest.approx(wanted)
    many = [
        row(7, DEAD, "one", 0.01 * n, "ActiveHinge", channel=n) for n in range(1, 23)
    ]
    labels = changes.ablation(table_of(many, ablation.COLUMNS)).scales[1].limits
    assert labels[-3:] == [
        "3rd motor dead",
        "2nd motor dead",
        "most important motor dead",
    ]
    assert labels[0] == "22nd motor dead"
    assert {f"{n}th motor dead" for n in (11, 12, 13)} < set(labels)
    with pytest.raises(NothingToDraw, match="positive fitness"):
        changes.ablation(
            table_of([row(7, HELD, "all", 0.1, undisturbed=0.0)], ablation.COLUMNS)
        )


ROWS = [
    changed(7, "start", 0.1), changed(7, "start", 0.06), changed(7, "friction", 0.04),
    changed(8, "start", 0.05, 0.05), changed(8, "start", None, 0.05),
    changed(8, "friction", 0.06, 0.05),
    changed(9, "start", 0.0, 0.0), changed(9, "start", 0.01, 0.0),
    changed(9, "friction", 0.02, 0.0),
]  # fmt: skip


def test_shares_are_of_the_fitness_without_changes() -> None:
    table = table_of(ROWS, robustness.COLUMNS)
    assert table.schema.names == [*robustness.COLUMNS]
    assert all(field.metadata[b"meaning"] for field in table.schema)
    shares = table["share"].to_pylist()
    assert shares[:4] == pytest.approx([1.0, 0.6, 0.4, 1.0])
    assert shares[4] is None
    assert shares[5] == pytest.approx(1.2)
    assert shares[6:] == [None, None, None]


def test_groups_count_equally() -> None:
    rows = table_of(ROWS, robustness.COLUMNS).to_pylist()
    assert kept(rows[:3]) == pytest.approx((0.8 + 0.4) / 2)
    assert kept(rows[3:6]) == pytest.approx((1.0 + 1.2) / 2)
    assert kept(rows[6:]) is None


def test_line_about_a_run() -> None:
    assert robustness.summary(table_of(ROWS, robustness.COLUMNS)) == (
        "the best ever, 0:7, keeps 60 % of its fitness (0.1000) on average, from 40 % "
        "under friction changed to 100 % under start changed; the last population of 3 "
        "keeps 85 % in the median, 60 % to 110 %; 1 of 9 evaluations failed"
    )
    failed = [changed(7, "start", None, None, is_last=False)]
    assert robustness.summary(table_of(failed, robustness.COLUMNS)) == (
        "the best ever, 0:7, has no fitness without changes; 1 of 1 evaluations failed"
    )
    still = [changed(7, "start", 0.1, -0.2)]
    assert robustness.summary(table_of(still, robustness.COLUMNS)) == (
        "the best ever, 0:7, has a fitness of -0.2000 without changes"
    )


def test_later_windows_are_told_apart_from_changes() -> None:
    late = [changed(birth, "later window", fitness, 0.1)
            for birth, each in ((7, (0.04, 0.02)), (8, (0.1, None)), (9, (0.07, 0.07)))
            for fitness in each]  # fmt: skip
    table = table_of([*ROWS[:6], *late], robustness.COLUMNS)
    rows = table.to_pylist()
    assert kept([*rows[:3], *rows[6:8]]) == pytest.approx(0.6)
    line = robustness.summary(table)
    assert "to 100 % under start changed, and sustains 30 % in later windows; " in line
    # Of the shares 30, 100 (of 0.05 without changes) and 70 %.
    assert "60 % to 110 %, and sustains 70 % in later windows; 2 of 12" in line


def test_figure_has_a_point_for_each_share() -> None:
    rows = [*ROWS, changed(7, "start", 0.09, change="start 0.1 mm higher")]
    last, best = (
        sorted(layer._data["share"])
        for layer in changes.robustness(table_of(rows, robustness.COLUMNS)).layers
        if isinstance(layer.geom, p9.geom_point)
    )
    assert last == pytest.approx([0.4, 0.6, 0.9, 1.0, 1.0, 1.2])
    assert best == pytest.approx([0.4, 0.6, 0.9, 1.0])
    with pytest.raises(NothingToDraw, match="positive fitness"):
        changes.robustness(table_of(ROWS[6:], robustness.COLUMNS))
