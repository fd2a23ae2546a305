"""Tests of the axes of interactive plots."""

import re

import pytest

from analysis.report.plots import Axes, dot, line, plot, with_margin


def test_ranges_include_zero_and_all_values() -> None:
    assert with_margin([]) == (0.0, 1.0)
    assert with_margin([0.0]) == (0.0, 1.0)
    assert with_margin([1.0, 2.0]) == pytest.approx((0.0, 2.08))
    assert with_margin([-1.0, 1.0]) == pytest.approx((-1.08, 1.08))


def test_marks_lie_between_the_axes() -> None:
    axes = Axes((0.0, 10.0), (0.0, 1.0))
    left, right = axes.x(0.0), axes.x(10.0)
    low, high = axes.y(0.0), axes.y(1.0)
    assert left < right
    assert low > high  # y grows downwards
    path = line(axes, [(0.0, 0.0), (5.0, 0.5)], "run")
    middle = f"{(left + right) / 2:.1f} {(low + high) / 2:.1f}"
    assert f'd="M{left:.1f} {low:.1f}L{middle}"' in path


def test_texts_are_escaped() -> None:
    axes = Axes((0.0, 1.0), (0.0, 1.0))
    drawn = plot(
        axes, [dot(1, 2, "<a> & b")], description='"d"', x_text="<x>", y_text="<y>"
    )
    assert "&lt;a&gt; &amp; b" in drawn
    assert re.findall("<[axy]>", drawn) == []
    assert 'aria-label="&quot;d&quot;"' in drawn
