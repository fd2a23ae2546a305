"""Tests of the axes of interactive plots."""

import re

import pytest

from analysis.report.plots import Axes, dot, plot, with_margin


def test_ranges_include_zero_and_all_values() -> None:
    assert with_margin([]) == (0.0, 1.0)
    assert with_margin([0.0]) == (0.0, 1.0)
    assert with_margin([1.0, 2.0]) == pytest.approx((0.0, 2.08))
    assert with_margin([-1.0, 1.0]) == pytest.approx((-1.08, 1.08))


def test_texts_are_escaped() -> None:
    axes = Axes((0.0, 1.0), (0.0, 1.0))
    drawn = plot(
        axes, [dot(1, 2, "<a> & b")], description='"d"', x_text="<x>", y_text="<y>"
    )
    assert "&lt;a&gt; &amp; b" in drawn
    assert re.findall("<[axy]>", drawn) == []
    assert 'aria-label="&quot;d&quot;"' in drawn
