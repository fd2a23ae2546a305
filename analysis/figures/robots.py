"""Figures of single robots, of their ancestors, and of Pareto fronts."""

from typing import Any

import numpy as np
import plotnine as p9
import pyarrow as pa
import pyarrow.compute as pc

from analysis.comparison.statistics import half_interval
from analysis.figures.forms import (
    SUMMARY_RUNS,
    NothingToDraw,
    Tables,
    fitness_panels,
    fitness_text,
)
from analysis.figures.style import (
    in_order,
    integer_breaks,
    label,
    ordered,
    panel_grid,
    scales,
    theme_of_size,
)

_POPULATIONS = {"final": "last populations", "born": "all robots ever evaluated"}
_BINS = {
    "count": (1.0, 0.0, "extremities"),
    "per_part": (0.1, 0.05, "extremities per part"),
}
"""Width of a bin, distance of its point from its lower end, and label of the axis."""
_DODGE = 0.13
"""Distance of two experiments' points, by that of two numbers of extremities."""


def variability(tables: Tables) -> p9.ggplot:
    """Return the density of the variability of robots' fitness in arenas.

    Raises:
        NothingToDraw: no two robots of an experiment differ in variability.

    Source: Hupkes 2016, figure 6.8.
    """
    rows = tables["variability"].filter(pc.field("variability").is_valid())
    frame = _varied(rows.to_pandas(), "experiment")
    if frame.empty:
        raise NothingToDraw("no two robots of an experiment differ in variability")
    line_colours, fill_colours = scales(tables, frame["experiment"])
    figure = p9.ggplot(frame, p9.aes("variability")) + fill_colours
    figure += p9.geom_density(p9.aes(fill="experiment"), alpha=0.25, colour="none")
    lines = _varied(frame, "folder")
    if not lines.empty:
        # A scale without a layer that uses it is a warning.
        figure += line_colours
        figure += p9.stat_density(
            p9.aes(colour="experiment", group="folder"),
            data=lines,
            geom="line",
            size=0.4,
            alpha=0.8,
            position="identity",
        )
    return (
        figure
        + p9.coord_cartesian(xlim=(0, 1))
        + p9.labs(
            x="range of a robot's fitness / range of the population's", y="density"
        )
        + theme_of_size(3.6)
    )


def _varied(robots: Any, group: str) -> Any:  # noqa: ANN401 - pandas
    """Return the robots of groups with different values: others have no density."""
    values = robots.groupby(group)["variability"]
    return robots[values.transform("max") > values.transform("min")]


def extremities_and_fitness(tables: Tables, by: str) -> p9.ggplot:
    """Return the mean fitness of robots by their extremities, over runs.

    Source: Hupkes 2016, figure 6.14.
    """
    rows = tables["extremities"].filter(pc.field("by") == by)
    keys = ["experiment", "population", "bin"]
    totals = [("fitness", "mean"), ("fitness", "stddev"), ("fitness", "count")]
    over_runs = rows.group_by(keys).aggregate(totals)
    shown = over_runs.rename_columns([*keys, "fitness", "sd", "runs"]).to_pandas()
    mean = shown["fitness"]
    half = half_interval(shown["sd"].to_numpy(), shown["runs"].to_numpy())
    half[shown["runs"] < SUMMARY_RUNS] = np.nan
    shown["low"], shown["high"] = mean - half, mean + half
    width, start, axis = _BINS[by]
    experiments = shown["experiment"]
    names = in_order(experiments)
    # Points of different experiments must not hide each other.
    aside = experiments.map(names.index) - (len(names) - 1) / 2
    shown["at"] = shown["bin"] + start + _DODGE * width * aside
    panels = ordered(shown["population"], _POPULATIONS)
    shown["panel"] = panels.cat.rename_categories(_POPULATIONS)
    functions = fitness_panels(tables)
    shown["function"] = experiments.map(functions)
    in_panels = ["function", "panel"] if functions else "panel"
    columns, lines = panel_grid(2 * (len(set(functions.values())) or 1), 2)
    of_line = shown.groupby(["experiment", "population"])["bin"]
    # The library warns of lines of one point.
    joined = shown[of_line.transform("size") > 1]
    return (
        p9.ggplot(shown, p9.aes("at", "fitness"))
        + p9.geom_linerange(
            p9.aes(ymin="low", ymax="high", colour="experiment"),
            na_rm=True,
            size=0.5,
            alpha=0.6,
            show_legend=False,
        )
        + p9.geom_line(p9.aes(colour="experiment"), data=joined, size=0.6)
        + p9.geom_point(p9.aes(colour="experiment"), size=1.3)
        + p9.facet_wrap(
            in_panels, ncol=columns, scales="free_y" if functions else "fixed"
        )
        + scales(tables, experiments, is_filled=False)
        + p9.expand_limits(y=0)
        + p9.labs(x=axis, y=fitness_text(tables, "mean fitness"))
        + theme_of_size(0.6 + 3.0 * lines)
    )


def lineages(tables: Tables) -> p9.ggplot:
    """Return all ancestors of the best robots, by number of birth and rank.

    Raises:
        NothingToDraw: no best robot has parents.

    Source: Hupkes 2016, 6.17 and on, and the rank of eq. 6.1.
    """
    rows = tables.get("lineage")
    if not rows or not any(rows["parents"].to_pylist()):
        raise NothingToDraw("no best robot has parents")
    known = {(row["experiment"], row["order"]): row for row in rows.to_pylist()}
    lines = [
        {**row, "to": above["number"], "to_rank": above["rank"]}
        for row in known.values()
        for above in (known[row["experiment"], parent] for parent in row["parents"])
    ]
    names = [label(name) for name in in_order(rows["experiment"].to_pylist())]
    return (
        p9.ggplot(rows.select(["experiment", "number", "rank"]).to_pandas())
        + p9.geom_segment(
            p9.aes("number", "rank", xend="to", yend="to_rank", colour="experiment"),
            data=pa.Table.from_pylist(lines).drop_columns("parents").to_pandas(),
            size=0.3,
            alpha=0.5,
            show_legend=False,
        )
        + p9.geom_point(
            p9.aes("number", "rank", colour="experiment"),
            size=0.8,
            show_legend=len(names) > 1,
        )
        + scales(tables, rows["experiment"].to_pylist(), is_filled=False)
        + p9.scale_y_continuous(breaks=integer_breaks)
        + p9.labs(x="number of birth", y="rank (founders 1, children one more)")
        + theme_of_size(4.2)
    )


def fronts(tables: Tables) -> p9.ggplot:
    """Return all births in the first two objectives, a line along each front."""
    frame = tables["fronts"].to_pandas()
    experiments = in_order(frame["experiment"])
    frame["line"] = frame["folder"] + " " + frame["island"].astype(str)
    # Panels have one pair of objectives each.
    frame["panel"] = frame["y_objective"] + " by " + frame["x_objective"]
    best = frame[frame["is_front"]].sort_values(["line", "x", "y"])
    columns, rows = panel_grid(panels := frame["panel"].nunique(), 2)
    figure = p9.ggplot(frame, p9.aes("x", "y", colour="experiment"))
    figure += p9.geom_point(size=0.8, alpha=0.3, stroke=0, show_legend=False)
    # Between two points the best is that of the one which is not better in x.
    is_less = frame["x_objective"].iloc[0].endswith("(min)")
    steps = {"direction": "hv" if is_less else "vh", "size": 0.5, "alpha": 0.8}
    figure += p9.geom_step(p9.aes(group="line"), best, **steps)
    figure += p9.geom_point(data=best, size=1.6, show_legend=False)
    if panels > 1:
        figure += p9.facet_wrap("panel", scales="free", ncol=columns)
        texts = {"x": "first objective", "y": "second objective"}
    else:
        texts = {axis: frame[f"{axis}_objective"].iloc[0] for axis in "xy"}
    figure += scales(tables, experiments, is_filled=False)
    return figure + p9.labs(**texts) + theme_of_size(0.8 + 3.6 * rows)
