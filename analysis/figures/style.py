"""How all figures look: one theme, one colour per experiment, one way into files."""

from collections.abc import Iterable
from pathlib import Path
from typing import Any

import plotnine as p9
from matplotlib import pyplot as plt
from matplotlib import rc_context
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from analysis.measures.distinct_names import MARK

WIDTH_IN = 7.0
DPI = 160

_THESIS = {
    "scenario1": "#0072B2",
    "scenario2": "#E69F00",
    "scenario3": "#009E73",
    "no-reproduction": "#7F7F7F",
    "no-selection": "#CC79A7",
}
OTHERS = ("#D55E00", "#56B4E9", "#8C6D31", "#5254A3", "#000000", "#B2DF8A", "#E7298A")
"""Colours of what has none of its own."""
_INK, _FAINT = "#333333", "#E6E6E6"
# Numbers of glyphs, not outlines, so that text in a PDF stays text.
_SETTINGS: dict[Any, Any] = {"pdf.fonttype": 42, "savefig.facecolor": "white"}
PICTURE_ENDING = ".png"
_ENDINGS = (PICTURE_ENDING, ".pdf")
_BROAD = 12


def in_order(experiments: Iterable[str]) -> list[str]:
    """Return experiments, each once: the thesis's first, in its order."""
    names = set(experiments)
    known = [name for name in _THESIS if name in names]
    return known + sorted(names.difference(_THESIS))


def colours(experiments: Iterable[str]) -> dict[str, str]:
    """Return each experiment's colour, in order.

    Those of the thesis have the same in every figure of every report.

    Source: Okabe and Ito, *Color universal design*, 2008: told apart by the
    colour-blind.
    """
    names = in_order(experiments)
    others = [name for name in names if name not in _THESIS]
    spare = {name: OTHERS[i % len(OTHERS)] for i, name in enumerate(others)}
    return {name: _THESIS.get(name) or spare[name] for name in names}


def label(experiment: str) -> str:
    """Return an experiment's name as figures say it."""
    name, mark, number = experiment.partition(MARK)
    if name.startswith("scenario") and name[8:].isdigit():
        said = f"scenario {name[8:]}"
    else:
        said = name.replace("-", " ")
    return f"{said} {mark}{number}" if mark else said


def broken(experiment: str) -> str:
    """Return the same for the foot of a column: on two lines if it is long."""
    said = label(experiment)
    if MARK in said:
        return said.replace(f" {MARK}", f"\n{MARK}")
    return said if len(said) < _BROAD else said.replace(" ", "\n", 1)


def scales(experiments: Iterable[str], *, is_filled: bool = True) -> list[Any]:
    """Return the scales that give experiments their colours, names and order.

    Args:
        experiments: that are shown.
        is_filled: whether anything has their colour inside.
    """
    chosen = colours(experiments)
    said = {
        "limits": list(chosen),
        "labels": [label(name) for name in chosen],
        "values": list(chosen.values()),
        "name": "",
    }
    lines = [p9.scale_colour_manual(**said)]
    return [*lines, p9.scale_fill_manual(**said)] if is_filled else lines


def whole(limits: tuple[float, float]) -> list[float]:
    """Return where a scale has its numbers if only whole ones mean something."""
    return list(MaxNLocator(nbins=6, integer=True).tick_values(*limits))


def paper(height_in: float, width_in: float = WIDTH_IN) -> Any:  # noqa: ANN401 - untyped
    """Return the theme, for a figure of this size."""
    return p9.theme_bw(base_size=10) + p9.theme(
        figure_size=(width_in, height_in),
        text=p9.element_text(colour=_INK),
        legend_position="top",
        legend_title=p9.element_blank(),
        legend_key=p9.element_blank(),
        panel_border=p9.element_blank(),
        panel_grid_minor=p9.element_blank(),
        panel_grid_major=p9.element_line(colour=_FAINT, size=0.5),
        axis_line=p9.element_line(colour=_INK, size=0.5),
        axis_ticks=p9.element_line(colour=_INK, size=0.5),
        strip_background=p9.element_blank(),
        strip_text=p9.element_text(weight="bold", ha="left", x=0),
        panel_spacing_x=0.04,
        panel_spacing_y=0.05,
    )


def save(figure: p9.ggplot | Figure, stem: Path) -> None:
    """Write a figure as PNG and PDF; draw it once.

    Args:
        figure: of plotnine, or drawn by matplotlib already.
        stem: path without an ending.
    """
    drawn = figure.draw() if isinstance(figure, p9.ggplot) else figure
    with rc_context(_SETTINGS):
        for ending in _ENDINGS:
            # No date: the same tables give the same bytes.
            dated = {"CreationDate": None} if ending == ".pdf" else {}
            path = stem.with_name(stem.name + ending)
            drawn.savefig(path, dpi=DPI, metadata=dated, bbox_inches="tight")
    plt.close(drawn)
