"""Figures that consist of rendered robots: gaits and family trees."""

from collections.abc import Mapping, Sequence

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import ConnectionPatch, Rectangle

from analysis.figures.family_tree import ordered
from analysis.figures.robot_pictures import FOUNDERS, Colour, RobotPicture
from analysis.figures.style import label
from analysis.measures.families import Family
from schema.robot.ids import BirthId

_INK, _FAINT = "#333333", "#9A9A9A"
_HEIGHT = 0.53
"""Height of a picture in a family tree in which each robot has a width of 1."""
_WIDTH = 0.94
_TITLE_IN = 0.36
"""Height of the two lines of text above a row of pictures [inches]."""
_STILL_M = 1e-4
"""Way during a gait below which a robot stands still [m]."""
_STEP = 1.0
"""Distance of two levels."""


def gaits(robot_pictures: Sequence[RobotPicture]) -> Figure:
    """Return one row of consecutive pictures per robot.

    Args:
        robot_pictures: pictures of the best robots; at least one.

    Source: Hupkes 2016, figure 6.10.
    """
    columns = max(len(one.gait) for one in robot_pictures)
    high = 8.0 / columns * 0.525
    total = len(robot_pictures) * (high + _TITLE_IN)
    figure = Figure(figsize=(8.0, total))
    axes = figure.subplots(len(robot_pictures), columns, squeeze=False)
    top = 1 - _TITLE_IN / total
    figure.subplots_adjust(0, 0, 1, top, wspace=0.02, hspace=_TITLE_IN / high)
    for row, one in zip(axes, robot_pictures, strict=True):
        for axis in row:
            axis.set_axis_off()
        for axis, picture, time_s in zip(row, one.gait, one.times_s, strict=False):
            axis.imshow(picture)
            axis.set_title(f"{time_s:.1f} s", fontsize=7, color=_FAINT, pad=2)
        way = f"moved {100 * one.moved_m:.2g} cm"
        if one.moved_m < _STILL_M:
            way = "stood still in these pictures"
        text = f"{label(one.best.experiment)}, fitness {one.best.fitness:.3g}, {way}"
        row[0].set_title("")
        row[0].set_title(text, loc="left", fontsize=8, color=_INK, pad=12)
    return figure


def family_tree(
    one: RobotPicture, relatives: Family, fitness: Mapping[BirthId, float]
) -> Figure:
    """Return a robot, its parents above it, and so on, and the founders on top.

    Args:
        one: pictures of the robot and its family.
        relatives: its family.
        fitness: fitness of its relatives.

    Source: Hupkes 2016, figures 6.18 to 6.20.
    """
    levels = ordered(relatives.levels, relatives.edges)
    width = float(max(5, *map(len, levels), len(relatives.founders)))
    spots = {
        row: ((at + 0.5) * width / len(level), _STEP * height)
        for height, level in enumerate(levels)
        for at, row in enumerate(level)
    }
    top = _STEP * (len(levels) - 1) + _HEIGHT
    figure = Figure(figsize=(8.0, 8.0 / width * (top + 1.75)))
    axes = figure.add_axes((0.0, 0.0, 1.0, 1.0))
    axes.set_axis_off()
    # As large as the space below a picture allows.
    size = max(6.5, min(10.0, 90.0 / width))
    for child, parent in relatives.edges:
        _line(axes, spots[child], spots[parent])
    for row, spot in spots.items():
        known = fitness.get(one.births[row])
        text = "" if known is None else f"{known:.3g}"
        text = f"{_name(one, row)}  {text}"
        _add_picture(axes, one, row, spot, text=text, size=size)
    line = top + 0.35
    axes.plot([0, width], [line, line], "--", color=_FAINT, linewidth=0.8)
    for at, row in enumerate(relatives.founders):
        spot = ((at + 0.5) * width / len(relatives.founders), line + 0.35)
        colour = FOUNDERS[min(at, len(FOUNDERS) - 1)]
        text = f"founder {_name(one, row)}"
        _add_picture(axes, one, row, spot, text=text, size=size, colour=colour)
    axes.set_xlim(0, width)
    axes.set_ylim(-0.25, line + 0.35 + _HEIGHT + 0.1)
    axes.set_aspect("equal")
    return figure


def _name(one: RobotPicture, row: int) -> str:
    """Return a robot's number of birth, after its island if that is another one."""
    island, number = one.births[row]
    return f"{number}" if island == one.best.birth_island else f"{island}:{number}"


Spot = tuple[float, float]
"""Middle of a picture's lower edge."""


def _add_picture(
    axes: Axes,
    one: RobotPicture,
    row: int,
    spot: Spot,
    *,
    text: str,
    size: float,
    colour: Colour | None = None,
) -> None:
    """Put a robot's picture into a figure, with a text below."""
    x, y = spot
    edges = (x - _WIDTH / 2, x + _WIDTH / 2, y, y + _HEIGHT)
    axes.imshow(one.pictures[row], extent=edges, zorder=2, interpolation="antialiased")
    axes.add_patch(
        Rectangle(
            (edges[0], edges[2]), edges[1] - edges[0], edges[3] - edges[2],
            fill=False, zorder=3, edgecolor=colour or _FAINT,
            linewidth=2.0 if colour else 0.6,
        )
    )  # fmt: skip
    axes.text(
        x, y - 0.03, text, ha="center", va="top", fontsize=size, color=_INK, zorder=4,
        bbox={"facecolor": "white", "edgecolor": "none", "pad": 0.6},
    )  # fmt: skip


def _line(axes: Axes, child: Spot, parent: Spot) -> None:
    """Draw a line from a child to its parent; dotted if the parent is not above it."""
    start = (child[0], child[1] + _HEIGHT)
    if parent[1] > child[1]:
        end = (parent[0], parent[1] - 0.18)
        axes.plot(*zip(start, end, strict=True), color=_FAINT, linewidth=0.9, zorder=1)
        return
    end = (parent[0], parent[1] + _HEIGHT)
    # Flat enough to stay below the next level.
    away = max(abs(end[0] - start[0]), abs(end[1] - start[1]))
    bend = min(0.25, 0.45 / max(away, 1.0)) * (1 if end[0] < start[0] else -1)
    axes.add_patch(
        ConnectionPatch(
            start, end, "data", "data", linestyle=(0, (1, 3)), linewidth=1.2, zorder=1,
            connectionstyle=f"arc3,rad={bend}", color=_FAINT,
        )
    )  # fmt: skip
