"""Scaffold of interactive plots: SVG with axes, and texts that a pointer shows.

SVG was chosen over a plotting library in the page because the report stays one small
file (plotly.js alone has 4.7 MB), is readable without scripts, and prints. Each mark
has a ``<title>``, which browsers show by themselves; ``page.js`` shows it at once.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from html import escape

from matplotlib.ticker import MaxNLocator

from analysis.figures.look import in_look

WIDTH, HEIGHT = 560, 360
_LEFT, _RIGHT, _TOP, _BOTTOM = 66, 24, 34, 52


@dataclass(frozen=True, slots=True)
class Axes:
    """Ranges of a plot's axes, and places in it [pixels].

    Attributes:
        x_range, y_range: least and greatest value.
    """

    x_range: tuple[float, float]
    y_range: tuple[float, float]

    def x(self, value: float) -> float:
        """Return the horizontal place of a value."""
        low, high = self.x_range
        return _LEFT + (value - low) / (high - low) * (WIDTH - _LEFT - _RIGHT)

    def y(self, value: float) -> float:
        """Return the vertical place of a value."""
        low, high = self.y_range
        along = (value - low) / (high - low)
        return HEIGHT - _BOTTOM - along * (HEIGHT - _TOP - _BOTTOM)


def with_margin(values: Iterable[float]) -> tuple[float, float]:
    """Return a range that includes values and 0, with a margin."""
    known = [0.0, *values]
    low, high = min(known), max(known)
    if low == high:
        return 0.0, 1.0
    margin = 0.04 * (high - low)
    return low - margin * (low < 0), high + margin


def _breaks(low: float, high: float) -> list[float]:
    numbers = MaxNLocator(5, steps=[1, 2, 5, 10]).tick_values(low, high)
    slack = 1e-9 * (high - low)
    return [round(n, 12) for n in numbers if low - slack <= n <= high + slack]


def line(axes: Axes, points: Iterable[tuple[float, float]], kind: str) -> str:
    """Return a line through points, of a class in the style sheet."""
    return f'<path class="{kind}" d="{_path(axes, points)}"/>'


def band(axes: Axes, rows: Sequence[tuple[float, float, float]]) -> str:
    """Return the area between two lines, given x, lower and upper y."""
    lower = [(x, low) for x, low, _ in rows]
    upper = [(x, high) for x, _, high in reversed(rows)]
    return f'<path class="band" d="{_path(axes, [*lower, *upper])}Z"/>'


def dot(x: float, y: float, text: str, radius: float = 3.2) -> str:
    """Return a mark at a place, with the text that a pointer shows."""
    return (
        f'<circle cx="{x:.1f}" cy="{y:.1f}" r="{radius}">'
        f"<title>{escape(text)}</title></circle>"
    )


def painted(colour: str, *marks: str, kind: str = "", text: str = "") -> str:
    """Return marks of one colour, with the text that a pointer shows on them.

    It is not shown on marks with a text of their own. ``kind`` is a class in the style
    sheet.
    """
    title = f"<title>{escape(text)}</title>" if text else ""
    paint = in_look(colour)
    return f'<g class="{kind}" style="color:{paint}">{title}{"".join(marks)}</g>'


def plot(
    axes: Axes,
    marks: Iterable[str],
    *,
    description: str,
    x_text: str,
    y_text: str,
    x_names: Sequence[tuple[float, str]] | None = None,
) -> str:
    """Return a plot as SVG; names at values of x may replace numbers.

    The description is for screen readers.
    """
    right, bottom = WIDTH - _RIGHT, HEIGHT - _BOTTOM
    numbered = [(value, f"{value:g}") for value in _breaks(*axes.x_range)]
    frame = [
        f'<path class="grid" d="M{_LEFT} {axes.y(value):.1f}H{right}"/>'
        f'<text class="y" x="{_LEFT - 6}" y="{axes.y(value) + 4:.1f}">{value:g}</text>'
        for value in _breaks(*axes.y_range)
    ] + [
        f'<text class="x" x="{axes.x(value):.1f}" y="{bottom + 18}">'
        f"{escape(name)}</text>"
        for value, name in (numbered if x_names is None else x_names)
    ]
    return (
        f'<svg class="plot" viewBox="0 0 {WIDTH} {HEIGHT}" role="img" '
        f'aria-label="{escape(description)}">'
        f"{''.join(frame)}"
        f'<path class="axis" d="M{_LEFT} {_TOP}V{bottom}H{right}"/>'
        f'<text class="x name" x="{(_LEFT + right) / 2}" y="{HEIGHT - 8}">'
        f"{escape(x_text)}</text>"
        f'<text x="4" y="18">{escape(y_text)}</text>{"".join(marks)}</svg>'
    )


def _path(axes: Axes, points: Iterable[tuple[float, float]]) -> str:
    places = [f"{axes.x(x):.1f} {axes.y(y):.1f}" for x, y in points]
    return f"M{'L'.join(places)}"
