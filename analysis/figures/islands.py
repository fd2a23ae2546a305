"""Figures of runs of several islands."""

import math
from itertools import islice

import numpy as np
import plotnine as p9
import pyarrow as pa
import pyarrow.compute as pc

from analysis.figures.forms import NothingToDraw, Tables, fitness_panels, fitness_text
from analysis.figures.look import LOOK, RAMP
from analysis.figures.style import (
    in_order,
    integer_breaks,
    label,
    legend,
    lone_points,
    panel_grid,
    scales,
    spare_colours,
    theme_of_size,
)

_PAIRS = {"within": "within islands", "between": "between islands"}


def fitness_by_island(tables: Tables) -> p9.ggplot:
    """Return the mean fitness of each island by number of births.

    Raises:
        NothingToDraw: no run has several islands, or none has a judged population.
    """
    several = _of_several(tables)["folder"]
    every = tables["populations"]
    chosen = pc.is_in(every["folder"], several.combine_chunks())
    frame = every.filter(chosen).filter(pc.field("fitness").is_valid()).to_pandas()
    if frame.empty:
        raise NothingToDraw("no run of several islands has a judged population")
    frame["island"] = frame["island"].astype(str)
    frame["line"] = frame["folder"] + " " + frame["island"]
    names = sorted(set(frame["island"]), key=int)
    heights = "free_y" if fitness_panels(tables) else "fixed"
    columns, rows = panel_grid(frame["experiment"].nunique(), 3)
    return (
        p9.ggplot(frame, p9.aes("births", "fitness"))
        + p9.geom_line(p9.aes(colour="island", group="line"), size=0.7, alpha=0.85)
        + lone_points(frame, ["island", "line"])
        + p9.facet_wrap("experiment", labeller=label, scales=heights, ncol=columns)
        + p9.scale_colour_manual(
            list(islice(spare_colours(), len(names))),
            limits=names,
            guide=legend(["island", *names]),
        )
        + p9.expand_limits(y=0)
        + p9.labs(
            x="births on the island",
            y=fitness_text(tables, "mean fitness"),
            colour="island ",
        )
        + theme_of_size(0.8 + 3.0 * rows)
        + p9.theme(legend_title=p9.element_text())
    )


def _of_several(tables: Tables) -> pa.Table:
    """Return the rows of ``runs`` with several islands; raise if there is none."""
    several = tables["runs"].filter(pc.field("islands") > 1)
    if not several:
        raise NothingToDraw("no run has several islands")
    return several


def between(tables: Tables) -> p9.ggplot:
    """Return the mean distances of bodies within and between islands, over runs.

    Raises:
        NothingToDraw: no run has several islands, or all have too few births.
    """
    _of_several(tables)
    rows = tables.get("between")
    if not rows:
        raise NothingToDraw("no run of several islands has 15 births on one of them")
    keys = ["experiment", "births"]
    frame = rows.to_pandas().rename(columns=_PAIRS)
    pairs = frame.melt(keys, list(_PAIRS.values()), "pairs", "distance")
    means = pairs.dropna().groupby([*keys, "pairs"], as_index=False)["distance"].mean()
    return (
        p9.ggplot(means, p9.aes("births", "distance"))
        + p9.geom_line(p9.aes(colour="experiment", linetype="pairs"), size=0.8)
        + lone_points(means, ["experiment", "pairs"], shape="pairs")
        + p9.scale_linetype_manual(["-", "--"], limits=list(_PAIRS.values()))
        + p9.scale_shape_manual(["o", "^"], limits=list(_PAIRS.values()))
        + scales(tables, rows["experiment"].to_pylist(), is_filled=False)
        + p9.expand_limits(y=0)
        + p9.labs(
            x="births on each island",
            y="mean tree edit distance",
            linetype="",
            shape="",
        )
        + theme_of_size(3.8)
    )


def migration_graph(tables: Tables) -> p9.ggplot:
    """Return the numbers of migrants between islands, and the share that survives."""
    rows = tables["migrants"]
    left = pc.greater(rows["living"], 0).cast(pa.float64())
    edges = (
        rows.append_column("line", left)
        .group_by(["experiment", "island", "to"])
        .aggregate([("line", "count"), ("line", "mean")])
    )
    names = in_order(rows["experiment"].to_pylist())
    spots = {name: _spots(rows, name) for name in names}
    places = []
    for row in edges.to_pylist():
        own = spots[row["experiment"]]
        places.append(row | _arrow(own[row["island"]], own[row["to"]]))
    islands = [
        {"experiment": name, "island": island, "x": x, "y": y}
        for name in names
        for island, (x, y) in spots[name].items()
    ]
    nodes = pa.Table.from_pylist(islands).to_pandas()
    return (
        p9.ggplot(pa.Table.from_pylist(places).to_pandas())
        + p9.geom_segment(
            p9.aes("x", "y", xend="xend", yend="yend", size="line_count",
                   colour="line_mean"),
            arrow=p9.arrow(length=0.1, type="closed", angle=22),
        )
        + p9.geom_point(p9.aes("x", "y"), data=nodes, size=9, fill="white", stroke=0.6)
        + p9.geom_text(p9.aes("x", "y", label="island"), data=nodes, size=9)
        + p9.facet_wrap("experiment", labeller=label)
        + p9.scale_size_continuous(range=(0.5, 2.0), breaks=integer_breaks,
                                   name="migrants")
        + p9.scale_colour_gradient(*RAMP, limits=(0, 1),
                                   name="share with\nliving line")
        + p9.coord_fixed(xlim=(-1.25, 1.25), ylim=(-1.25, 1.25))
        + p9.labs(x="", y="")
        + theme_of_size(4.6)
        + p9.theme(
            axis_text=p9.element_blank(), axis_ticks=p9.element_blank(),
            axis_line=p9.element_blank(), panel_grid=p9.element_blank(),
            legend_title=p9.element_text(),
            legend_position="bottom" if LOOK.get().is_narrow else "right",
        )
    )  # fmt: skip


Spot = tuple[float, float]


def _spots(rows: pa.Table, experiment: str) -> dict[int, Spot]:
    """Return the places of an experiment's islands: on a circle, from its top."""
    mine = rows.filter(pc.field("experiment") == experiment)
    islands = sorted({*mine["island"].to_pylist(), *mine["to"].to_pylist()})
    angles = 2 * math.pi * np.arange(len(islands)) / len(islands)
    return {
        island: (math.sin(angle), math.cos(angle))
        for island, angle in zip(islands, angles.tolist(), strict=True)
    }


def _arrow(start: Spot, end: Spot) -> dict[str, float]:
    """Return an arrow with a gap at both ends, shifted to its right."""
    along = np.subtract(end, start)
    along = along / (np.linalg.norm(along) or 1.0)
    aside = 0.04 * np.array([along[1], -along[0]])
    (x, y), (xend, yend) = start + 0.17 * along + aside, end - 0.19 * along + aside
    return {"x": float(x), "y": float(y), "xend": float(xend), "yend": float(yend)}
