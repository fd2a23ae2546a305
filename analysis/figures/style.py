"""Style of all figures: theme, colour and label of each experiment, files."""

import io
import math
import re
import warnings
from collections.abc import Iterable, Iterator, Mapping, Sequence
from colorsys import hls_to_rgb
from itertools import count
from pathlib import Path
from typing import Any

import plotnine as p9
import pyarrow as pa
from matplotlib import pyplot as plt
from matplotlib import rc_context, rcdefaults
from matplotlib.colors import to_hex
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator
from plotnine.exceptions import PlotnineWarning

from analysis.figures.look import FAINT, INK, LOOK, OTHERS, THESIS, dress
from analysis.measures.distinct_names import MARK

# Not the settings of a user's file matplotlibrc.
rcdefaults()
DPI = 300

_SHORT = {"no-reproduction": "random", "no-selection": "drift"}
"""What the baselines are: random search and drift."""
_GOLDEN = 0.618034
"""Golden ratio: multiples of it are far from each other on a circle."""
_LIGHTNESS = (0.3, 0.68, 0.47)
# TrueType fonts instead of outlines, so that text in a PDF stays text.
_SETTINGS: dict[Any, Any] = {
    "pdf.fonttype": 42, "svg.fonttype": "none", "svg.hashsalt": "revolve",
}  # fmt: skip
_SIZE_PT, _NARROW_PT = 10.0, 9.0
"""Sizes of text in wide and narrow figures; that of axes is four fifths."""
_NARROW_HEIGHT = 0.75
"""Height of a panel in narrow figures, by that in wide ones."""
_LETTER = 0.58
"""Mean width of a letter, by the size of the text."""
_BROAD = 12
_MOST_BYTES = 100
"""Length of a file's name: file systems allow 255 bytes, endings included."""


def file_name(text: str) -> str:
    """Return words as the name of a file without ending: safe and not too long."""
    name = "-".join(re.findall(r"[\w.~+=]+", text))
    return name.encode()[:_MOST_BYTES].decode(errors="ignore")


def in_order(experiments: Iterable[str]) -> list[str]:
    """Return each experiment once, those of the thesis first, in its order."""
    names = set(experiments)
    known = [name for name in THESIS if name in names]
    return known + sorted(names.difference(THESIS))


def colours(experiments: Iterable[str]) -> dict[str, str]:
    """Return each experiment's colour, in order.

    Experiments of the thesis have the same colour in every figure of every report,
    unless the user chose others.
    """
    paint, spare = {**THESIS, **LOOK.get().chosen}, spare_colours()
    return {name: paint.get(name) or next(spare) for name in in_order(experiments)}


def spare_colours() -> Iterator[str]:
    """Yield different colours: those of ``OTHERS``, then hues all around the circle."""
    yield from OTHERS
    for number in count():
        hue, lightness = number * _GOLDEN % 1, _LIGHTNESS[number % len(_LIGHTNESS)]
        yield to_hex(hls_to_rgb(hue, lightness, 0.75)).upper()


def label(experiment: str) -> str:
    """Return the label of an experiment in figures.

    Only names of the thesis's experiments are changed: users look for their own names.
    """
    name, mark, number = experiment.partition(MARK)
    text = name
    if name in THESIS:
        text = re.sub(r"(?<=\D)(?=\d)", " ", name).replace("-", " ")
    return f"{text} {mark}{number}" if mark else text


def pair_name(finding: Mapping[str, Any]) -> str:
    """Return the short names of a finding's experiments; † marks a near-automatic one.

    Names of the thesis are shortened: 1, 2 and 3 are the scenarios.
    """
    experiments = (finding[key] for key in "ab" if finding[key])
    names = (
        _SHORT.get(experiment) or re.sub(r"^scenario(?=\d)", "", experiment)
        for experiment in experiments
    )
    return "/".join(names) + "†" * bool(finding["near_automatic"])


def two_line_label(experiment: str) -> str:
    """Return the label of an experiment, on two lines if it is long."""
    text = label(experiment)
    if MARK in text:
        return text.replace(f" {MARK}", f"\n{MARK}")
    if len(text) < _BROAD:
        return text
    # After the first space or hyphen.
    return re.sub(r"(?<=[ -])", "\n", text, count=1).replace(" \n", "\n")


def scales(
    tables: Mapping[str, pa.Table],
    experiments: Iterable[str],
    *,
    is_filled: bool = True,
) -> list[Any]:
    """Return the scales of colour, and of fill, of a figure's experiments.

    The experiments of ``runs``, if there, determine the colours, so that these are the
    same in all figures.
    """
    shown = in_order(experiments)
    of_all = tables["runs"]["experiment"].to_pylist() if "runs" in tables else ()
    paint = colours([*of_all, *shown])
    labels = [label(name) for name in shown]
    settings = {
        "limits": shown,
        "labels": labels,
        "values": [paint[name] for name in shown],
        "name": "",
    }
    lines = [p9.scale_colour_manual(**settings, guide=legend(labels))]
    areas = [p9.scale_fill_manual(**settings, guide=legend(labels))]
    return lines + areas * is_filled


def legend(labels: Sequence[str]) -> p9.guide_legend:
    """Return a legend of as many rows as the labels need."""
    wide_in = sum(map(text_in, labels)) + 0.4 * len(labels)
    return p9.guide_legend(nrow=math.ceil(wide_in / (LOOK.get().width_in - 0.5)))


def text_in(text: str) -> float:
    """Return about how wide a text of a legend or axis is [inches]."""
    size = _NARROW_PT if LOOK.get().is_narrow else _SIZE_PT
    return 0.8 * size / 72 * _LETTER * max(map(len, text.split("\n")))


def panel_grid(count: int, most: int) -> tuple[int, int]:
    """Return columns and rows of panels; narrow figures have a column less."""
    columns = max(1, min(count, most - LOOK.get().is_narrow))
    return columns, -(-count // columns)


def lone_points(
    lines: Any,  # noqa: ANN401 - pandas
    keys: list[str],
    **aesthetics: str,
) -> list[p9.geom_point]:
    """Return a layer with the points that are alone in their line, if there are some.

    A line of one point is not drawn. Keys are the columns that tell lines and panels
    apart; the first is their colour.
    """
    alone = lines[lines.groupby(keys)[keys[0]].transform("size") == 1]
    points = p9.geom_point(p9.aes(colour=keys[0], **aesthetics), data=alone, size=1.5)
    return [points] if len(alone) else []


def ordered(names: Any, order: Iterable[str]) -> Any:  # noqa: ANN401 - pandas
    """Return names as categories, of columns from the top, in an order."""
    return names.astype("category").cat.set_categories([*order])


def integer_breaks(limits: tuple[float, float]) -> list[float]:
    """Return the breaks of a scale of integers."""
    return list(MaxNLocator(nbins=6, integer=True).tick_values(*limits))


def theme_of_size(height_in: float) -> Any:  # noqa: ANN401 - untyped
    """Return the theme for a figure of this height [inches]."""
    look = LOOK.get()
    size_pt, factor = _SIZE_PT, 1.0
    if look.is_narrow:
        size_pt, factor = _NARROW_PT, _NARROW_HEIGHT
    return p9.theme_bw(base_size=size_pt) + p9.theme(
        figure_size=(look.width_in, factor * height_in),
        text=p9.element_text(colour=INK),
        legend_position="top",
        legend_title=p9.element_blank(),
        legend_key=p9.element_blank(),
        legend_background=p9.element_blank(),
        panel_border=p9.element_blank(),
        panel_grid_minor=p9.element_blank(),
        panel_grid_major=p9.element_line(colour=FAINT, size=0.5),
        axis_line=p9.element_line(colour=INK, size=0.5),
        axis_ticks=p9.element_line(colour=INK, size=0.5),
        strip_background=p9.element_blank(),
        strip_text=p9.element_text(weight="bold", ha="left", x=0),
        panel_spacing_x=0.04,
        panel_spacing_y=0.05,
    )


def stored(figure: p9.ggplot | Figure, formats: Iterable[str]) -> dict[str, bytes]:
    """Return a figure in some formats, in the look of now."""
    with warnings.catch_warnings():
        # A line of one point is not drawn: see ``lone_points``.
        warnings.simplefilter("ignore", PlotnineWarning)
        drawn = figure.draw() if isinstance(figure, p9.ggplot) else figure
    dress(drawn)
    files = {}
    # Without a date, the same tables give the same bytes.
    undated = {"pdf": {"CreationDate": None}, "svg": {"Date": None}}
    with rc_context(_SETTINGS):
        for kind in formats:
            file = io.BytesIO()
            drawn.savefig(file, format=kind, dpi=DPI, metadata=undated.get(kind))
            files[kind] = file.getvalue()
    plt.close(drawn)
    return files


def save(
    figure: p9.ggplot | Figure, stem: Path, formats: Sequence[str] = ("pdf", "png")
) -> bytes:
    """Write a figure to a path without an ending; return it as PNG."""
    files = stored(figure, {"png": None, **dict.fromkeys(formats)})
    for kind in formats:
        stem.with_name(f"{stem.name}.{kind}").write_bytes(files[kind])
    return files["png"]
