"""Archive map as SVG: a pointer on a cell shows its robot, large, and its fitness.

Each robot is a drawing of its own, of which the pointer shows a large copy:
films of 400 robots would make a page of 100 MB.
"""

from html import escape
from itertools import groupby

from analysis.figures.archive_maps import ArchiveMap, MapCell, map_axes
from analysis.figures.look import in_look
from analysis.render.plan import Outline

_WIDTH, _LEFT, _RIGHT, _ABOVE, _BELOW = 1000.0, 100.0, 30.0, 16.0, 72.0
_HALF = 100
"""Half width of the drawing of a cell, in its own units; a robot takes 86 % of it."""
_ROBOT = 172


def interactive_map(one: ArchiveMap) -> str:
    """Return a map as SVG."""
    across, along = one.bins
    side = (_WIDTH - _LEFT - _RIGHT) / across
    high = side * along
    marks = "".join(_cell(one, cell, side) for cell in one.cells)
    edge = f'<path class="axis" d="M{_LEFT} 0V{high:.1f}H{_WIDTH - _RIGHT}"/>'
    name = escape(f"Archive map of {one.experiment}")
    return (
        f'<svg class="plot map" viewBox="0 {-_ABOVE} {_WIDTH} '
        f'{_ABOVE + high + _BELOW:.1f}" '
        f'role="img" aria-label="{name}">{edge}{_axes(one, side)}{marks}</svg>'
    )


def _axes(one: ArchiveMap, side: float) -> str:
    high = side * one.bins[1]
    turned = f'transform="translate(24 {high / 2:.1f}) rotate(-90)"'
    middle = f'x="{(_LEFT + _WIDTH - _RIGHT) / 2}" y="{high + 62:.1f}"'
    texts = []
    for place, (name, ticks) in zip((middle, turned), map_axes(one), strict=False):
        texts.append(f'<text class="x" {place}>{escape(name)}</text>')
        for at, text in ticks:
            spot = f'class="y" x="{_LEFT - 8}" y="{high - at * side + 6:.1f}"'
            if place == middle:
                spot = f'class="x" x="{_LEFT + at * side:.1f}" y="{high + 28:.1f}"'
            texts.append(f"<text {spot}>{text}</text>")
    return "".join(texts)


def _cell(one: ArchiveMap, cell: MapCell, side: float) -> str:
    x, y = _LEFT + cell.x * side, (one.bins[1] - 1 - cell.y) * side
    lines = [f"robot {cell.robot}: fitness {cell.fitness:.3g}"]
    for name, (low, high), bins, at in zip(
        one.grid.measures, one.grid.bounds, one.bins, (cell.x, cell.y), strict=False
    ):
        step = (high - low) / bins
        lines.append(f"{name} {low + at * step:.3g} to {low + (at + 1) * step:.3g}")
    title = escape("\n".join(lines))
    paths = "".join(
        f'<path color="{in_look(colour)}" d="{"".join(map(_path, outlines))}"/>'
        for colour, outlines in groupby(cell.outlines, key=lambda each: each.colour)
    )
    box = f"{-_HALF} {-_HALF} {2 * _HALF} {2 * _HALF}"
    edge = f'x="{-_HALF}" y="{-_HALF}" width="{2 * _HALF}" height="{2 * _HALF}"'
    return (
        f'<svg class="robot" x="{x:.1f}" y="{y:.1f}" width="{side:.1f}" '
        f'height="{side:.1f}" viewBox="{box}"><title>{title}</title>'
        f'<rect {edge} fill="{in_look(one.colour(cell))}"/>{paths}</svg>'
    )


def _path(outline: Outline) -> str:
    """Return a polygon in whole units, y downwards."""
    x, y = (_ROBOT * outline.corners).round().astype(int).T
    (first, *others) = zip(x.tolist(), (-y).tolist(), strict=True)
    points = [first, *(point for point in others if point != first)]
    return "M" + "L".join(f"{left} {top}" for left, top in points) + "Z"
