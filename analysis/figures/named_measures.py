"""Figure of the measures that experiments name."""

import re

import plotnine as p9

from analysis.figures.forms import Tables
from analysis.figures.style import in_order, lone_points, scales, theme_of_size

_NARROW = 3
"""Panels in a row."""
UNITS = {
    "path_velocity": "m/s",
    "straight_velocity": "m/s",
    "turning": "rad/s",
    "energy": "J",
    "height": "m",
    "joint_effort": "N m",
}
"""Units of the measures that come with the toolkit and have one."""


def measures_over_births(tables: Tables) -> p9.ggplot:
    """Return the mean of each measure over births, a line per run and island."""
    frame = tables["named_measures"].to_pandas()
    frame["line"] = frame["folder"] + " " + frame["island"].astype(str)
    experiments = in_order(frame["experiment"])
    frame["measure"] = list(map(_with_unit, frame["measure"], frame["about"]))
    lines = -(-frame["measure"].nunique() // _NARROW)
    return (
        p9.ggplot(frame, p9.aes("births", "mean"))
        + p9.geom_line(p9.aes(colour="experiment", group="line"), size=0.6, alpha=0.8)
        + lone_points(frame, ["experiment", "line", "measure"])
        + p9.facet_wrap("measure", ncol=_NARROW, scales="free_y")
        + scales(tables, experiments, is_filled=False)
        + p9.labs(x="births on the island", y="mean of the population")
        + theme_of_size(1.0 + 2.0 * lines)
    )


def _with_unit(measure: str, about: str) -> str:
    """Return a measure's name and unit, of an own one the last of its docstring."""
    *_, unit = [UNITS.get(measure, ""), *re.findall(r"\[([^][]+)\]", about)]
    return f"{measure} [{unit}]" if unit else measure
