"""Findings of the thesis as effects: one row per pair of experiments."""

from collections.abc import Sequence
from itertools import groupby
from textwrap import wrap
from typing import Any

import pyarrow.compute as pc
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.ticker import FixedLocator, FuncFormatter, NullLocator
from matplotlib.transforms import ScaledTranslation

from analysis.comparison.findings import LARGE, NEGLIGIBLE
from analysis.figures.forms import NothingToDraw, Row, Tables
from analysis.figures.look import BLUE, GREY, INK, LOOK, RULE, VERMILION
from analysis.figures.style import pair_name

_MARKS: dict[str, dict[str, Any]] = {
    "reproduced": {"color": BLUE, "marker": "o", "markersize": 4.2},
    "undecided": {"color": GREY, "marker": "o", "markerfacecolor": "white",
                  "markersize": 4.2},
    "not reproduced": {"color": VERMILION, "marker": "X", "markersize": 5.4},
}  # fmt: skip
"""Look of each verdict: by shape as well as colour."""
_SIGNS = {">": ">", "<": "<", "=": "≈", "!=": "≠"}
_SHADE, _BOUND = "#E4E4E4", "#555555"
_SMALL, _TEXT = 7.0, 7.5
_LETTER_IN, _LINE_IN = 0.058, 0.122
"""Width of a letter, and height of a row."""
_NAMES_IN, _RIGHT_IN, _TICKS_IN, _BELOW_IN = 0.78, 0.12, 0.26, 0.45
"""Space around panels: names of pairs, right of them, ticks above, axis label."""
_NUMBER_PT, _HEADING_PT = -55, -30
"""Places of a figure's number and of a heading, from the left end of the axis."""
_GAP = 0.6
"""Space below a finding, and above the first one [lines]."""
_NOTE = (
    "A/B are the compared experiments: 1, 2 and 3 are the scenarios, random is random "
    "search (no reproduction), drift is no selection. † says nothing about evolution."
)
_DECADES = [10.0**power for power in range(6)]


def effects(tables: Tables) -> Figure:
    """Return the effects by which the thesis's findings are tested.

    Left: pairs of experiments, with Cliff's delta. Right: experiments that are compared
    with a number, with the difference divided by its margin. Both with 95 % intervals.

    Raises:
        NothingToDraw: no finding could be tested.
    """
    tested = tables["findings"].filter(pc.field("effect").is_valid())
    if not tested.num_rows:
        raise NothingToDraw("no finding has two finished runs of each experiment")
    rows = [row for row in tested.to_pylist() if row["expected"] != "some"]
    kinds = [[row for row in rows if bool(row["b"]) == is_pair]
             for is_pair in (True, False)]  # fmt: skip
    panels = [kind for kind in kinds if kind]
    if not panels:
        raise NothingToDraw("no finding compares runs with each other or a number")
    wide = LOOK.get().width_in
    # Below each other in a narrow figure.
    columns = 1 if LOOK.get().is_narrow else len(panels)
    figure = Figure()
    every = figure.subplots(len(panels) // columns, columns, squeeze=False)
    letters = int((wide / columns - _NAMES_IN - _HEADING_PT / 72) / _LETTER_IN)
    lines = [
        _draw_panel(axes, panel, letters)
        for axes, panel in zip(every.flat, panels, strict=True)
    ]
    heights = [max(lines)] if columns > 1 else lines
    for axes, height in zip(every.flat, heights * columns, strict=True):
        axes.set_ylim(height, 0)
    top_in, above = _add_head(figure), _TICKS_IN + _BELOW_IN
    high = top_in + _LINE_IN * sum(heights) + above * len(heights)
    figure.set_size_inches(wide, high)
    every[0, 0].get_gridspec().set_height_ratios(heights)
    gaps = _NAMES_IN + _RIGHT_IN
    figure.subplots_adjust(
        _NAMES_IN / wide, _BELOW_IN / high, 1 - _RIGHT_IN / wide,
        1 - (top_in + _TICKS_IN) / high, wspace=gaps / (wide / columns - gaps),
        hspace=above / (_LINE_IN * sum(heights) / len(heights)),
    )  # fmt: skip
    return figure


def _draw_panel(axes: Axes, rows: Sequence[Row], letters: int) -> float:
    """Draw findings of one kind below each other; return their height [lines]."""
    at, previous = _GAP, ""
    for (number, topic, expected), group in groupby(rows, _heading):
        if previous and number != previous:
            axes.plot([-0.22, 1], [at - _GAP / 3] * 2, color=RULE, lw=0.6,
                      transform=axes.get_yaxis_transform(), clip_on=False)  # fmt: skip
        if number != previous:
            _write(axes, at + 0.45, number, _NUMBER_PT, weight="bold")
        previous = number
        for text in wrap(f"{topic} ({expected})", letters):
            _write(axes, at + 0.45, text, _HEADING_PT)
            at += 1
        own = list(group)
        _draw_rows(axes, own, at)
        at += len(own) + _GAP
    _set_axis(axes, is_pair=bool(rows[0]["b"]))
    return at


def _heading(row: Row) -> tuple[str, str, str]:
    """Return figure, topic and what is expected: "A > B", or "< 0.5" of a number."""
    sign = _SIGNS[row["expected"]]
    if row["b"]:
        expected = f"A {sign} B"
    else:
        expected = sign if row["mean_b"] is None else f"{sign} {row['mean_b']:.3g}"
    return row["figure"], row["topic"] or row["claim"], expected


def _write(
    axes: Axes,
    height: float,
    text: str,
    aside_pt: int,
    **look: Any,  # noqa: ANN401 - of any text
) -> None:
    axes.annotate(
        text, (0, height), (aside_pt, 0), axes.get_yaxis_transform(), "offset points",
        va="center_baseline", fontsize=_SMALL, color=INK, **look,
    )  # fmt: skip


def _draw_rows(axes: Axes, rows: Sequence[Row], top: float) -> None:
    """Draw the rows of a finding, and the bounds between them."""
    bottom, is_pair = top + len(rows), bool(rows[0]["b"])
    bound = NEGLIGIBLE if is_pair else 1
    axes.fill_between([-bound, bound], top, bottom, color=_SHADE, lw=0, zorder=0)
    axes.vlines(0, top, bottom, color=_BOUND, lw=0.6, zorder=1)
    if is_pair:
        axes.vlines([-LARGE, LARGE], top, bottom, color=_BOUND, lw=0.8,
                    linestyles=":", zorder=1)  # fmt: skip
    name = "effect" if is_pair else "difference"
    for at, row in enumerate(rows):
        middle = top + at + 0.5
        shown: list[Any] = [
            None if row[end] is None else row[end] / (1 if is_pair else row["margin"])
            for end in (name, f"{name}_low", f"{name}_high")
        ]
        value, *ends = shown
        look = _MARKS[row["verdict"]]
        if None not in ends:
            axes.plot(ends, [middle] * 2, color=look["color"], lw=1.2, zorder=2)
        axes.plot(value, middle, ls="", zorder=3, **look)
        _write(axes, middle, pair_name(row), -3, ha="right")


def _set_axis(axes: Axes, *, is_pair: bool) -> None:
    if is_pair:
        text, ticks = "Cliff's delta (positive: A above B)", [-1, -0.5, 0, 0.5, 1]
        axes.set_xlim(-1.05, 1.05)
    else:
        text = "(mean - number) / margin, logarithmic beyond ±1"
        low, high = axes.dataLim.intervalx
        axes.set_xscale("symlog", linthresh=1, linscale=0.8)
        axes.set_xlim(1.2 * min(-2.0, low), 1.2 * max(2.0, high))
        ticks = [-value for value in _DECADES] + [0.0, *_DECADES]
    axes.xaxis.set_major_locator(FixedLocator(ticks))
    axes.xaxis.set_minor_locator(NullLocator())
    axes.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axes.set_xlabel(text, fontsize=_TEXT, color=INK, labelpad=3)
    axes.tick_params(top=True, labeltop=True, labelsize=_SMALL, length=2.5, pad=2)
    axes.tick_params(color=INK, labelcolor=INK)
    axes.yaxis.set_major_locator(NullLocator())
    axes.spines[["left", "right"]].set_visible(False)


def _add_head(figure: Figure) -> float:
    """Add the legend, and a note below it; return their height [inches]."""
    bounds = [
        Patch(color=_SHADE, label=f"negligible: ±{NEGLIGIBLE}, or ± the margin"),
        Line2D([], [], color=_BOUND, ls=":", label=f"±{LARGE}: alike within it"),
    ]
    marks = [Line2D([], [], lw=1.2, label=name, **look)
             for name, look in _MARKS.items()]  # fmt: skip
    columns = 1 if LOOK.get().is_narrow else 3
    figure.legend(
        handles=[*marks, *bounds], loc="upper center", ncols=columns, frameon=False,
        fontsize=_TEXT, labelcolor=INK, borderaxespad=0.3, columnspacing=1.6,
    )  # fmt: skip
    legend_in = 0.12 + 0.155 * -(-len([*marks, *bounds]) // columns)
    note = wrap(_NOTE, int(LOOK.get().width_in / _LETTER_IN))
    figure.text(
        0.5, 1, "\n".join(note), ha="center", va="top", fontsize=_SMALL, color=INK,
        transform=figure.transFigure + ScaledTranslation(
            0, -legend_in, figure.dpi_scale_trans
        ),
    )  # fmt: skip
    return legend_in + _LINE_IN * len(note)
