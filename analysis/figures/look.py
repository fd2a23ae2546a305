"""How figures and report look: width and colours. All colours are of one table.

Figures are drawn in the colours of light pages; ``dress`` changes them, so that no
figure needs to know of other styles.
"""

from collections.abc import Iterator, Mapping, Sequence
from colorsys import hls_to_rgb, rgb_to_hls
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from matplotlib import colormaps
from matplotlib.artist import Artist
from matplotlib.collections import Collection
from matplotlib.colors import (
    ListedColormap,
    is_color_like,
    to_hex,
    to_rgb,
    to_rgba_array,
)
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.text import Text

from analysis.figures.flags import WIDTHS_IN
from schema.errors import RevolveError, counted

INK, GREY, RULE, FAINT = "#333333", "#6E6E6E", "#9A9A9A", "#E6E6E6"
"""Texts, what is less important, thin lines, grids."""
BLUE, ORANGE, GREEN, PINK, VERMILION = (
    "#0072B2", "#E69F00", "#009E73", "#CC79A7", "#D55E00",
)  # fmt: skip
THESIS = {
    "scenario1": BLUE,
    "scenario2": ORANGE,
    "scenario3": GREEN,
    "no-reproduction": "#7F7F7F",
    "no-selection": PINK,
}
"""Colours of the thesis's experiments.

Source: Okabe and Ito, *Color universal design*, 2008: distinguishable for the
colour-blind.
"""
OTHERS = (VERMILION, "#56B4E9", "#8C6D31", "#5254A3", "#0A0A0A", "#B2DF8A", "#E7298A")
"""Colours of experiments that are not in the thesis; black is that of axes."""
RAMP = ("#C6DBEF", "#084594")
"""Colours of small and great numbers; their lightness falls."""
_DARKEST, _LIGHTEST, _VIVID, _SOFT = 0.09, 0.92, 0.62, 0.85
"""Lightness of paper, of ink and, at most, of colours in the dark style; factor of
their saturation."""
_GREYS = (0.0, 0.58, 0.26, 0.72, 0.42)
_DASHES = ("-", (0, (5, 2)), (0, (1, 1.2)), (0, (5, 1.5, 1, 1.5)))
_HATCHES = ("", "////", "....", "xxxx", "\\\\\\\\", "---", "|||")
"""Greys, lines and areas of the print style, by the place of a colour in the table.

Their numbers have no common divisor: twenty lines differ."""
_HATCHED = 0.3
"""Opacity from which on areas are hatched: paler ones lie over others."""
_NEUTRAL = 0.2
"""Saturation below which a colour is a grey."""


@dataclass(frozen=True, slots=True)
class Look:
    """How figures and report look.

    Attributes:
        width_in: width of figures [inches].
        style: of ``flags.STYLES``.
        chosen: colours that a user chose, by experiment.
    """

    width_in: float = WIDTHS_IN["page"]
    style: str = "light"
    chosen: Mapping[str, str] = field(default_factory=dict)

    @property
    def is_narrow(self) -> bool:
        """Whether figures have two thirds of the width of a page at most."""
        return 1.5 * self.width_in <= WIDTHS_IN["page"]


LOOK: ContextVar[Look] = ContextVar("look", default=Look())  # noqa: B039 - frozen
"""Look of what is drawn now; as settings of matplotlib are."""


@contextmanager
def dressed_in(look: Look) -> Iterator[None]:
    """Let a look be that of now."""
    before = LOOK.set(look)
    try:
        yield
    finally:
        LOOK.reset(before)


def chosen_colours(names: Sequence[str], experiments: Sequence[str]) -> dict[str, str]:
    """Return the colours of experiments, in order, of ``--colours``.

    Args:
        names: colours, or one colour map; none for the table's.
        experiments: in the order of legends.

    Raises:
        RevolveError: a name is unknown, or there are too few colours.
    """
    count = len(experiments)
    if len(names) == 1 and names[0] in colormaps:
        colours = colormaps[names[0]]
        places = (np.arange(count) + 0.5) / count
        # Maps of few colours list them.
        many = colours(places if colours.N > 20 else np.arange(min(count, colours.N)))  # noqa: PLR2004
        names = list(map(to_hex, many))
    for name in names:
        if not is_color_like(name):
            rule = "must be colours, or a colour map, of matplotlib"
            raise RevolveError(f"--colours: {rule}, got {name[:80]!r}")
    if names and len(names) < count:
        have = counted(len(names), "colour")
        raise RevolveError(f"--colours: {have} for {counted(count, 'experiment')}")
    return dict(zip(experiments, map(to_hex, names), strict=False))


def in_look(colour: str) -> str:
    """Return what a colour of light pages is in the look of now, as ``#rrggbb``."""
    look = LOOK.get()
    colour = to_hex(colour)
    if look.style == "light" or colour in look.chosen.values():
        return colour
    red, green, blue = to_rgb(colour)
    if look.style == "print":
        place = _place(colour)
        grey = 0.299 * red + 0.587 * green + 0.114 * blue
        grey = grey if place is None else _GREYS[place % len(_GREYS)]
        return to_hex((grey, grey, grey))
    hue, lightness, saturation = rgb_to_hls(red, green, blue)
    light = _DARKEST + (1.0 - lightness) * (_LIGHTEST - _DARKEST)
    if saturation >= _NEUTRAL:
        light = min(_VIVID, 1.25 - lightness)
    return to_hex(hls_to_rgb(hue, light, _SOFT * saturation))


def _place(colour: str) -> int | None:
    """Return the place of a colour among those of experiments, None of another one."""
    table = [*LOOK.get().chosen.values(), *map(to_hex, (*THESIS.values(), *OTHERS))]
    return table.index(colour) if colour in table else None


def dress(figure: Figure) -> None:
    """Give a figure, drawn in the colours of light pages, the look of now."""
    style = LOOK.get().style
    if style == "light":
        return
    # Ticks are made when they are drawn.
    figure.draw_without_rendering()
    for artist in figure.findobj():
        if isinstance(artist, Text) and (box := artist.get_bbox_patch()):
            _recolour(box, is_printed=False)
        _recolour(artist, is_printed=style == "print")


def _recolour(artist: Artist, *, is_printed: bool) -> None:
    """Change the colours of an artist; if printed, also its lines and areas."""
    if isinstance(artist, Collection) and artist.get_array() is not None:
        ramp = artist.get_cmap()(np.linspace(0.0, 1.0, 256))
        artist.set_cmap(ListedColormap([in_look(to_hex(each)) for each in ramp]))
        return
    keys: tuple[str, ...] = ("facecolor", "edgecolor")
    if isinstance(artist, Line2D):
        keys = ("markerfacecolor", "markeredgecolor", "color")
    elif isinstance(artist, Text):
        keys = ("color",)
    elif not isinstance(artist, Patch | Collection):
        return
    places = []
    for key in keys:
        given: Any = getattr(artist, f"get_{key}")()
        before = to_rgba_array(given)
        if not len(before) or not before[:, 3].any():
            continue
        places += [(_place(to_hex(one)), float(one[3])) for one in before]
        after = before.copy()
        after[:, :3] = [to_rgb(in_look(to_hex(one))) for one in before]
        getattr(artist, f"set_{key}")(after if len(after) > 1 else after[0])
    if is_printed and len({place for place, _ in places}) <= 1 + ("edgecolor" in keys):
        _mark(artist, *next((one for one in places if one[0] is not None), (None, 0.0)))


def _mark(artist: Artist, place: int | None, opacity: float) -> None:
    """Give a line dashes, or an area a hatching, by its colour's place."""
    if place is None:
        return
    dashes: Any = _DASHES[place % len(_DASHES)]
    if isinstance(artist, Line2D):
        if artist.get_linestyle() == "-":
            artist.set_linestyle(dashes)
    elif isinstance(artist, Patch | Collection) and opacity >= _HATCHED:
        artist.set_hatch(_HATCHES[place % len(_HATCHES)])
