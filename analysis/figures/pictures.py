"""Figures that consist of rendered robots: gaits and family trees."""

from collections.abc import Mapping, Sequence
from textwrap import fill

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import ConnectionPatch, Rectangle

from analysis.figures.family_tree import ordered
from analysis.figures.look import GREY, INK, LOOK, RULE
from analysis.figures.robot_pictures import FOUNDERS, Colour, RobotPicture
from analysis.figures.style import label
from analysis.measures.families import Family
from schema.robot.ids import BirthId

_SMALL = 8.0
"""Size of the texts that explain lines and numbers."""
_DOTS = (0, (1, 3))
_HEIGHT = 0.53
"""Height of a picture in a family tree in which each robot has a width of 1."""
_WIDTH = 0.94
_ROOMY_IN = 0.7
"""Least width of a picture with more than a number below it [inches]."""
_STILL_M = 1e-4
"""Way during a gait below which a robot stands still [m]."""
_STEP = 1.0
"""Distance of two levels."""
_RIM, _BELOW = 0.35, 0.25
"""Distance of the line below founders from pictures; space below the lowest robot."""


def gaits(robot_pictures: Sequence[RobotPicture], units: Mapping[str, str]) -> Figure:
    """Return one row of consecutive pictures per robot; units are by experiment.

    Source: Hupkes 2016, figure 6.10.
    """
    columns, wide = (
        max(len(robot.gait) for robot in robot_pictures),
        LOOK.get().width_in,
    )
    texts = [
        fill(_heading(robot, units.get(robot.best.experiment, "")), int(wide / 0.063))
        for robot in robot_pictures
    ]
    title_in = 0.23 + 0.13 * max(1 + text.count("\n") for text in texts)
    high = wide / columns * 0.525
    total = len(robot_pictures) * (high + title_in)
    figure = Figure(figsize=(wide, total))
    axes = figure.subplots(len(robot_pictures), columns, squeeze=False)
    top = 1 - title_in / total
    figure.subplots_adjust(0, 0, 1, top, wspace=0.02, hspace=title_in / high)
    for row, robot, text in zip(axes, robot_pictures, texts, strict=True):
        for axis in row:
            axis.set_axis_off()
        for axis, picture, time_s in zip(row, robot.gait, robot.times_s, strict=False):
            axis.imshow(picture)
            axis.set_title(f"{time_s:.1f} s", fontsize=7, color=GREY, pad=2)
        row[0].annotate(
            text, (0, 1), (1, 13), "axes fraction", "offset points", fontsize=_SMALL,
            color=INK,
        )  # fmt: skip
    return figure


def _heading(robot: RobotPicture, unit: str) -> str:
    way = f"moved {100 * robot.moved_m:.2g} cm in {robot.times_s[-1]:.1f} s"
    if robot.moved_m < _STILL_M:
        way = "stood still in these pictures"
    fitness = f"{robot.best.fitness:.3g}" + f" ({unit})" * bool(unit)
    return f"{label(robot.best.experiment)}, fitness {fitness}, {way}"


def family_tree(
    robot: RobotPicture,
    relatives: Family,
    fitness: Mapping[BirthId, float],
    unit: str = "",
) -> Figure:
    """Return a robot, its parents above it, and so on, and the founders on top.

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
    wide = LOOK.get().width_in
    is_roomy = wide / width >= _ROOMY_IN
    # As large as the space below a picture allows.
    size = max(7.0, min(10.0, 11.0 * wide / width))
    founders_at = top + _RIM + 0.35 + 1.5 * _SMALL / 72 * width / wide
    end = founders_at + _HEIGHT + 0.1
    # Below the lowest robot are the key and its name.
    below = _BELOW if is_roomy else 0.55 * width / wide
    figure = Figure(figsize=(wide, wide / width * (end + below)))
    axes = figure.add_axes((0.0, 0.0, 1.0, 1.0))
    axes.set_axis_off()
    for child, parent in relatives.edges:
        _line(axes, spots[child], spots[parent])
    for row, spot in spots.items():
        known = fitness.get(robot.births[row])
        text = _name(robot, row)
        if known is not None and is_roomy:
            text += f"  {known:.3g}"
        _add_picture(axes, robot, row, spot, text=text, size=size)
    if relatives.founders:
        _add_rim(axes, width, top + _RIM)
    for at, row in enumerate(relatives.founders):
        spot = ((at + 0.5) * width / len(relatives.founders), founders_at)
        colour = FOUNDERS[min(at, len(FOUNDERS) - 1)]
        text = "founder " * is_roomy + _name(robot, row)
        _add_picture(axes, robot, row, spot, text=text, size=size, colour=colour)
    axes.set_xlim(0, width)
    axes.set_ylim(-below, end)
    axes.set_aspect("equal")
    is_dotted = any(spots[up][1] <= spots[down][1] for down, up in relatives.edges)
    text = f"fitness [{unit}]" if unit else "fitness"
    _add_key(axes, f", {text}" * is_roomy, is_dotted=is_dotted)
    return figure


def _add_rim(axes: Axes, width: float, height: float) -> None:
    axes.plot([0, width], [height] * 2, "--", color=RULE, linewidth=0.8)
    axes.annotate(
        "founders whose parts these robots have", (0, height), (3, 2), "data",
        "offset points", fontsize=_SMALL, color=GREY,
    )  # fmt: skip


def _add_key(axes: Axes, more: str, *, is_dotted: bool) -> None:
    axes.text(
        0.01, 0.02, f"below each robot: number of\nits birth{more}", va="bottom",
        fontsize=_SMALL, color=GREY, transform=axes.transAxes,
    )  # fmt: skip
    lines = [
        Line2D([], [], color=RULE, linewidth=0.9, label="parent"),
        Line2D([], [], color=RULE, linewidth=1.2, linestyle=_DOTS,
               label="parent on another level"),
    ]  # fmt: skip
    axes.legend(
        handles=lines[: 1 + is_dotted], loc="lower right", frameon=False,
        fontsize=_SMALL, labelcolor=GREY, borderaxespad=0.4, borderpad=0.2,
        labelspacing=0.3,
    )  # fmt: skip


def _name(robot: RobotPicture, row: int) -> str:
    """Return a robot's number of birth, after its island if that is another one."""
    island, number = robot.births[row]
    return f"{number}" if island == robot.best.birth_island else f"{island}:{number}"


Spot = tuple[float, float]
"""Middle of a picture's lower edge."""


def _add_picture(
    axes: Axes,
    robot: RobotPicture,
    row: int,
    spot: Spot,
    *,
    text: str,
    size: float,
    colour: Colour | None = None,
) -> None:
    x, y = spot
    edges = (x - _WIDTH / 2, x + _WIDTH / 2, y, y + _HEIGHT)
    axes.imshow(
        robot.pictures[row], extent=edges, zorder=2, interpolation="antialiased"
    )
    axes.add_patch(
        Rectangle(
            (edges[0], edges[2]), edges[1] - edges[0], edges[3] - edges[2],
            fill=False, zorder=3, edgecolor=colour or RULE,
            linewidth=2.0 if colour else 0.6,
        )
    )  # fmt: skip
    axes.text(
        x, y - 0.03, text, ha="center", va="top", fontsize=size, color=INK, zorder=4,
        bbox={"facecolor": "white", "edgecolor": "none", "pad": 0.6},
    )  # fmt: skip


def _line(axes: Axes, child: Spot, parent: Spot) -> None:
    """Draw a line from a child to its parent; dotted if the parent is not above it."""
    start = (child[0], child[1] + _HEIGHT)
    if parent[1] > child[1]:
        end = (parent[0], parent[1] - 0.18)
        axes.plot(*zip(start, end, strict=True), color=RULE, linewidth=0.9, zorder=1)
        return
    end = (parent[0], parent[1] + _HEIGHT)
    # Flat enough to stay below the next level.
    away = max(abs(end[0] - start[0]), abs(end[1] - start[1]))
    bend = min(0.25, 0.45 / max(away, 1.0)) * (1 if end[0] < start[0] else -1)
    axes.add_patch(
        ConnectionPatch(
            start, end, "data", "data", linestyle=_DOTS, linewidth=1.2, zorder=1,
            connectionstyle=f"arc3,rad={bend}", color=RULE,
        )
    )  # fmt: skip
