"""Tests of the figure of the thesis's findings."""

from typing import Any

import numpy as np
import pytest
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from analysis.comparison.claims import CLAIMS
from analysis.figures.findings import effects
from analysis.figures.forms import NothingToDraw
from tests.analysis.drawn import Row, table


def pair(a: str, b: str, effect: float, **others: Any) -> Row:  # noqa: ANN401 - values
    """Return a finding about two experiments."""
    return {
        "figure": "6.2", "topic": "A ends fitter than B", "expected": ">", "a": a,
        "b": b, "effect": effect, "effect_low": effect - 0.2,
        "effect_high": effect + 0.1, "verdict": "reproduced", **others,
    }  # fmt: skip


def number(a: str, difference: float, **others: Any) -> Row:  # noqa: ANN401 - values
    """Return a finding about an experiment and the number 5."""
    return {
        "figure": "6.9", "topic": "robots grow", "expected": ">", "a": a, "b": "",
        "mean_b": 5.0, "effect": 1.0, "margin": 0.5, "difference": difference,
        "difference_low": difference - 1, "difference_high": difference + 2,
        "verdict": "undecided", **others,
    }  # fmt: skip


def drawn(*rows: Row) -> Figure:
    figure = effects({"findings": table("findings", list(rows))})
    figure.canvas.draw()
    return figure


def texts(axes: Axes) -> list[str]:
    return [text.get_text() for text in axes.texts]


def spans(axes: Axes) -> list[tuple[float, ...]]:
    """Return the ends of each interval and the place of each mark."""
    inside = [line for line in axes.lines if line.get_transform() == axes.transData]
    return [tuple(np.asarray(line.get_xdata(), float)) for line in inside]


def marks(axes: Axes) -> list[Line2D]:
    return [line for line in axes.lines if line.get_linestyle() == "None"]


def test_each_pair_has_a_row_with_its_name_and_interval() -> None:
    rows = [
        pair("scenario1", "no-reproduction", 0.5),
        pair("scenario2", "no-selection", 0.7, near_automatic=True),
    ]
    (axes,) = drawn(*rows).axes
    assert texts(axes) == [
        "6.2", "A ends fitter than B (A > B)", "1/random", "2/drift†",
    ]  # fmt: skip
    assert spans(axes) == [(0.3, 0.6), (0.5,), pytest.approx((0.5, 0.8)), (0.7,)]
    heights = [float(np.asarray(mark.get_ydata())[0]) for mark in marks(axes)]
    names: list[Any] = axes.texts[2:]
    assert heights == [name.xy[1] for name in names]
    assert axes.get_xlabel() == "Cliff's delta (positive: A above B)"


def test_a_number_has_a_panel_of_differences_in_margins() -> None:
    few = number("no-selection", 2.0, difference_low=None, difference_high=None)
    figure = drawn(number("scenario3", 4.0), few, pair("scenario1", "x", 0.5))
    pairs, numbers = figure.axes
    assert texts(pairs)[-1] == "1/x"
    assert texts(numbers) == ["6.9", "robots grow (> 5)", "3", "drift"]
    # 4 by 0.5; without an interval there is only a mark.
    assert spans(numbers) == [(6.0, 12.0), (8.0,), (4.0,)]
    low, high = numbers.get_xlim()
    assert low < -1
    assert high > 12
    assert "margin" in numbers.get_xlabel()


def test_no_text_is_cut() -> None:
    long = [f"{'a long finding ' * (n % 7)}{n}" for n in range(30)]
    pairs = [pair("scenario1", "no-reproduction", 0.1, topic=text) for text in long]
    numbers = [
        number("scenario3-touches", 1.0, topic=text, figure=f"7.1.{n}")
        for n, text in enumerate(long[:9])
    ]
    figure = drawn(*pairs, *numbers)
    page = figure.bbox
    for axes, left in zip(figure.axes, (page.x0, 0.5 * page.x1), strict=True):
        for text in axes.texts:
            box = text.get_window_extent()
            assert left <= box.x0 < box.x1 <= page.x1, text.get_text()
            assert page.y0 <= box.y0 < box.y1 <= page.y1, text.get_text()


def test_findings_without_numbers_are_named_as_missing() -> None:
    untested = {**pair("scenario1", "x", 0.1), "effect": None}
    with pytest.raises(NothingToDraw, match="no finding has two finished runs"):
        drawn(untested)
    with pytest.raises(NothingToDraw, match="no finding compares runs"):
        drawn(number("scenario1", 1.0, expected="some", margin=None))


def test_every_claim_about_a_number_has_a_margin() -> None:
    """Differences are shown as multiples of it."""
    alone = [one for one in CLAIMS if one.b is None and one.expected != "some"]
    assert alone
    assert all(one.margin > 0 for one in alone)
