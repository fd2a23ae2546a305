"""Findings of the thesis as effects: one row per pair of experiments."""

from collections.abc import Sequence
from itertools import groupby
from textwrap import wrap
from typing import Any, NamedTuple

import pyarrow.compute as pc
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.ticker import FixedLocator, FuncFormatter, NullLocator

from analysis.comparison.verdicts import LARGE, NEGLIGIBLE
from analysis.figures.forms import NothingToDraw, Row, Tables
from analysis.figures.style import INK, pair_name

_MARKS: dict[str, dict[str, Any]] = {
    "reproduced": {"color": "#0072B2", "marker": "o", "markersize": 4.2},
    "undecided": {"color": "#8C8C8C", "marker": "o", "markerfacecolor": "white",
                  "markersize": 4.2},
    "not reproduced": {"color": "#D55E00", "marker": "X", "markersize": 5.4},
}  # fmt: skip
"""Look of each verdict: by shape as well as colour."""
_SIGNS = {">": ">", "<": "<", "=": "≈", "!=": "≠"}
_SHADE, _BOUND, _RULE = "#E4E4E4", "#555555", "#C8C8C8"
_SMALL, _TEXT = 7.0, 7.5
_WORDS: dict[str, Any] = {"va": "center_baseline", "fontsize": _SMALL, "color": INK}
"""Look of headings and names."""
_LETTER_IN = 0.0565
"""Width of a letter of a heading [inches], rather more than the mean."""

_WIDTH_IN, _LINE_IN = 9.0, 0.122
_NAMES_IN, _NUMBER_IN, _RIGHT_IN = 0.78, 0.36, 0.12
"""Widths: names of pairs, number of the figure in a heading, right of a panel."""
_TOP_IN, _ABOVE_IN, _BELOW_IN = 0.62, 0.22, 0.5
"""Heights: legend; ticks above a panel; ticks, label and space below it."""
_GAP = 0.6
"""Space below a finding, and above the first one [lines]."""
_NOTE = (
    "A/B are the compared experiments: 1, 2 and 3 are the scenarios, random is random "
    "search (no reproduction), drift is no selection. † says nothing about evolution."
)
_DECADES = 6


class _Finding(NamedTuple):
    """A finding, and the pairs or experiments by which it is tested."""

    figure: str
    heading: list[str]
    rows: list[Row]

    @property
    def lines(self) -> float:
        """Height [lines]."""
        return len(self.heading) + len(self.rows) + _GAP

    @property
    def is_of_pairs(self) -> bool:
        """Whether it compares experiments with each other, not with a number."""
        return bool(self.rows[0]["b"])


Panel = list[_Finding]
"""Findings that share an axis."""


def effects(tables: Tables) -> Figure:
    """Return the effects by which the thesis's findings are tested.

    Pairs of experiments have Cliff's delta, experiments that are compared with a
    number have the difference divided by its margin; both with 95 % intervals.

    Raises:
        NothingToDraw: no finding could be tested.
    """
    rows = tables["findings"].filter(pc.field("effect").is_valid())
    if not rows.num_rows:
        raise NothingToDraw("no finding has two finished runs of each experiment")
    shown = [row for row in rows.to_pylist() if row["expected"] != "some"]
    if not shown:
        raise NothingToDraw("no finding compares runs with each other or a number")
    columns = _columns(_findings(shown))
    height = _TOP_IN + max(map(_height_in, columns))
    figure = Figure(figsize=(_WIDTH_IN, height))
    width = _WIDTH_IN / len(columns)
    for at, panels in enumerate(columns):
        top = height - _TOP_IN
        for panel in panels:
            high = _LINE_IN * _lines(panel)
            top -= _ABOVE_IN + high
            wide = width - _NAMES_IN - _RIGHT_IN
            box = (at * width + _NAMES_IN, top, wide, high)
            _draw_panel(_axes(figure, box), panel, wide)
            top -= _BELOW_IN
    _share_limits(figure)
    _add_legend(figure, height)
    return figure


def _findings(rows: Sequence[Row]) -> list[_Finding]:
    """Return findings without names of experiments: those of pairs first."""

    def key(row: Row) -> tuple[str, ...]:
        return row["figure"], row["topic"] or row["claim"], _expected(row)

    letters = int((_WIDTH_IN / 2 - _NUMBER_IN - _RIGHT_IN) / _LETTER_IN)
    found = []
    for is_number in (False, True):
        mine = [row for row in rows if is_number == (not row["b"])]
        for (figure, topic, expected), group in groupby(mine, key):
            heading = wrap(f"{topic} ({expected})", letters)
            found.append(_Finding(figure, heading, list(group)))
    return found


def _expected(row: Row) -> str:
    """Return what is expected, for example "A > B", or "< 0.5" of a number."""
    sign = _SIGNS[row["expected"]]
    if row["b"]:
        return f"A {sign} B"
    return sign if row["mean_b"] is None else f"{sign} {row['mean_b']:.3g}"


def _columns(found: Sequence[_Finding]) -> list[list[Panel]]:
    """Return the panels of two columns of about equal height, or of one."""
    ways = [
        [_panels(found[:cut]), _panels(found[cut:])] for cut in range(1, len(found) + 1)
    ]
    best = min(ways, key=lambda columns: max(map(_height_in, columns)))
    return [panels for panels in best if panels]


def _panels(found: Sequence[_Finding]) -> list[Panel]:
    return [list(group) for _, group in groupby(found, lambda one: one.is_of_pairs)]


def _height_in(panels: Sequence[Panel]) -> float:
    return sum(_LINE_IN * _lines(panel) + _ABOVE_IN + _BELOW_IN for panel in panels)


def _lines(panel: Panel) -> float:
    """Return the height of a panel [lines]."""
    return _GAP + sum(one.lines for one in panel)


def _axes(figure: Figure, box_in: tuple[float, float, float, float]) -> Axes:
    """Return axes at a place in inches, without a frame at the sides."""
    wide, high = figure.get_size_inches()
    left, bottom, width, height = box_in
    axes = figure.add_axes((left / wide, bottom / high, width / wide, height / high))
    axes.tick_params(top=True, labeltop=True, labelsize=_SMALL, length=2.5, pad=2)
    axes.tick_params(color=INK, labelcolor=INK)
    axes.yaxis.set_major_locator(NullLocator())
    for side in ("left", "right"):
        axes.spines[side].set_visible(False)
    return axes


def _draw_panel(axes: Axes, panel: Panel, width_in: float) -> None:
    """Draw findings below each other.

    Args:
        axes: axes of the panel.
        panel: its findings.
        width_in: width of the axes [inches].
    """
    place = axes.get_yaxis_transform()
    left = -_NAMES_IN / width_in
    at, previous = _GAP, ""
    for one in panel:
        if previous and one.figure != previous:
            axes.plot([left, 1], [at - _GAP / 3] * 2, color=_RULE, lw=0.6,
                      transform=place, clip_on=False)  # fmt: skip
        if one.figure != previous:
            axes.text(left + 0.01, at + 0.45, one.figure, transform=place,
                      weight="bold", **_WORDS)  # fmt: skip
        previous = one.figure
        for text in one.heading:
            axes.text(left + _NUMBER_IN / width_in, at + 0.45, text, transform=place,
                      **_WORDS)  # fmt: skip
            at += 1
        _draw_rows(axes, one, at)
        at += len(one.rows) + _GAP
    axes.set_ylim(at, 0)
    text = "Cliff's delta (positive: A above B)"
    if not panel[0].is_of_pairs:
        text = "(mean - number) / margin, logarithmic beyond ±1"
        axes.set_xscale("symlog", linthresh=1, linscale=0.8)
    axes.set_xlabel(text, fontsize=_TEXT, color=INK, labelpad=3)


def _draw_rows(axes: Axes, one: _Finding, top: float) -> None:
    """Draw the rows of a finding, and the bounds between them."""
    bottom = top + len(one.rows)
    bound = NEGLIGIBLE if one.is_of_pairs else 1
    axes.fill_between([-bound, bound], top, bottom, color=_SHADE, lw=0, zorder=0)
    axes.vlines(0, top, bottom, color=_BOUND, lw=0.6, zorder=1)
    if one.is_of_pairs:
        axes.vlines([-LARGE, LARGE], top, bottom, color=_BOUND, lw=0.8,
                    linestyles=":", zorder=1)  # fmt: skip
    for at, row in enumerate(one.rows):
        middle = top + at + 0.5
        value, ends = _shown(row)
        look = _MARKS[row["verdict"]]
        if None not in ends:
            axes.plot(ends, [middle] * 2, color=look["color"], lw=1.2, zorder=2)
        axes.plot([value], [middle], ls="", zorder=3, **look)
        axes.annotate(
            pair_name(row), (0, middle), (-3, 0), axes.get_yaxis_transform(),
            "offset points", ha="right", **_WORDS,
        )  # fmt: skip


def _shown(row: Row) -> tuple[Any, tuple[Any, Any]]:
    """Return the place of a row's mark, and the ends of its interval or nulls."""
    if row["b"]:
        return row["effect"], (row["effect_low"], row["effect_high"])
    value, low, high = (
        None if row[name] is None else row[name] / row["margin"]
        for name in ("difference", "difference_low", "difference_high")
    )
    return value, (low, high)


def _share_limits(figure: Figure) -> None:
    """Give axes of the same kind equal limits and ticks."""
    numbers = [axes for axes in figure.axes if axes.get_xscale() != "linear"]
    for axes in figure.axes:
        if axes not in numbers:
            axes.set_xlim(-1.05, 1.05)
            axes.xaxis.set_major_locator(FixedLocator([-1, -0.5, 0, 0.5, 1]))
        axes.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    ends = [end for axes in numbers for end in axes.dataLim.intervalx]
    decades = [10.0**power for power in range(_DECADES)]
    for axes in numbers:
        axes.set_xlim(min(-2.0, *ends) * 1.2, max(2.0, *ends) * 1.2)
        ticks = [-value for value in decades] + [0.0, *decades]
        axes.xaxis.set_major_locator(FixedLocator(ticks))
        axes.xaxis.set_minor_locator(NullLocator())


def _add_legend(figure: Figure, height_in: float) -> None:
    bounds = [
        Patch(color=_SHADE, label=f"negligible: ±{NEGLIGIBLE}, or ± the margin"),
        Line2D([], [], color=_BOUND, ls=":", label=f"±{LARGE}: alike within it"),
    ]
    marks = [Line2D([], [], lw=1.2, label=name, **look)
             for name, look in _MARKS.items()]  # fmt: skip
    figure.legend(
        handles=[*marks, *bounds], loc="upper center", ncols=5, frameon=False,
        fontsize=_TEXT, labelcolor=INK, borderaxespad=0.3, columnspacing=1.6,
    )  # fmt: skip
    at = 1 - 0.42 / height_in
    figure.text(0.5, at, _NOTE, ha="center", fontsize=_SMALL, color=INK)
