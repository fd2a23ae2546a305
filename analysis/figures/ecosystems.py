"""Figures of arenas with rules of their own: courses, ages at death, maps."""

from typing import Any

import numpy as np
import plotnine as p9

from analysis.figures.forms import Tables
from analysis.figures.look import INK, RAMP
from analysis.figures.style import (
    label,
    lone_points,
    ordered,
    panel_grid,
    scales,
    theme_of_size,
)

_COURSES = {
    "living": "living robots",
    "energy": "mean energy",
    "born": "births per minute",
}
_BIN_S = 60.0
_BINS = 40
_CORNERS = 40
"""Corners of a drawn disc."""
_MOST_ARENAS = 4
"""Arenas of a map."""


def life_courses(tables: Tables) -> p9.ggplot:
    """Return living robots, mean energy and births over simulated time."""
    frame = tables["life_courses"].to_pandas()
    minute = np.ceil(frame["sim_time_s"] / _BIN_S)
    frame["line"] = frame["folder"] + " " + frame["island"].astype(str)
    groups = frame.groupby(["experiment", "line", minute.rename("minute")])
    means = groups.agg(
        living=("living", "mean"), energy=("energy", "mean"), born=("born", "sum")
    )
    long = means.reset_index().melt(
        ["experiment", "line", "minute"], [*_COURSES], var_name="what"
    )
    long["what"] = ordered(long["what"].map(_COURSES), _COURSES.values())
    long = long.dropna()
    several = frame["experiment"].nunique() > 1
    return (
        p9.ggplot(long, p9.aes("minute", "value", colour="experiment"))
        + p9.geom_line(p9.aes(group="line"), size=0.7, alpha=0.8)
        + lone_points(long, ["experiment", "what", "line"])
        + p9.facet_wrap("what", ncol=1, scales="free_y")
        + scales(tables, frame["experiment"], is_filled=False)
        + p9.expand_limits(y=0)
        + p9.labs(x="simulated time [min]", y="")
        + theme_of_size(5.4)
        + p9.theme(**({} if several else {"legend_position": "none"}))
    )


def ages_at_death(tables: Tables) -> p9.ggplot:
    """Return the ages at death, by reason."""
    frame = tables["lifespans"].to_pandas()
    reasons = frame["reason"].value_counts()
    named = {reason: f"{reason} ({count})" for reason, count in reasons.items()}
    # The library's own bins lose values at their ends.
    width_s = max(float(frame["age_s"].max()) / _BINS, 1.0)
    middle_s = (np.floor(frame["age_s"] / width_s) + 0.5) * width_s
    groups = frame.groupby(["experiment", frame["reason"].map(named), middle_s])
    counts = groups.size().rename("robots").reset_index()
    counts["reason"] = ordered(counts["reason"], named.values())
    columns, rows = panel_grid(counts["experiment"].nunique(), 3)
    return (
        p9.ggplot(counts, p9.aes("age_s", "robots", fill="reason"))
        + p9.geom_col(width=width_s, colour="white", size=0.2)
        + p9.facet_wrap("experiment", labeller=label, scales="free_y", ncol=columns)
        + p9.scale_fill_brewer(type="qual", palette="Set2")
        + p9.labs(x="age at death [s]", y="robots")
        + theme_of_size(0.6 + 3.0 * rows)
    )


def ground_map(tables: Tables) -> Any:  # noqa: ANN401 - untyped
    """Return a map of places of birth, patches, and lines between parents."""
    born, joined, patches = (
        _first_arenas(tables, name)
        for name in ("birth_places", "couples", "patch_means")
    )
    lines = {"x": "first_x", "y": "first_y", "xend": "second_x", "yend": "second_y"}
    columns, rows = panel_grid(born["panel"].nunique(), 2)
    return (
        p9.ggplot(born, p9.aes("x", "y"))
        + p9.geom_polygon(
            p9.aes(fill="content", group="disc"), data=_discs(patches), alpha=0.6
        )
        + p9.geom_segment(
            p9.aes(**lines, colour="related"), data=joined, size=0.5, alpha=0.8
        )
        + p9.geom_point(p9.aes(size="children"), colour=INK, alpha=0.6, stroke=0)
        + p9.facet_wrap("panel", ncol=columns)
        + p9.scale_fill_gradient("#F3E9D2", "#7FB069", name="mean content ")
        + p9.scale_colour_gradient(*RAMP, limits=(0, 1), name="related ")
        + p9.scale_size_area(max_size=4, name="children ")
        + p9.coord_fixed()
        + p9.labs(x="x [m]", y="y [m]")
        + theme_of_size(1.2 + (3.4 if rows > 1 else 5.0) * rows)
        + p9.theme(legend_title=p9.element_text())
    )


def _first_arenas(tables: Tables, name: str) -> Any:  # noqa: ANN401 - pandas
    arenas = tables["birth_places"].select(["folder", "island"]).to_pandas()
    shown = arenas.drop_duplicates().head(_MOST_ARENAS)
    rows = tables[name].to_pandas().merge(shown, on=["folder", "island"])
    folder = rows["folder"].map(lambda path: path.rpartition("/")[2]).astype(str)
    rows["panel"] = folder + ", island " + rows["island"].astype(str)
    return rows


def _discs(patches: Any) -> Any:  # noqa: ANN401 - pandas
    """Return the corners of the discs of patches."""
    angles = np.linspace(0.0, 2.0 * np.pi, _CORNERS)
    discs = patches.assign(disc=np.arange(len(patches)))
    corners = discs.loc[discs.index.repeat(_CORNERS)]
    turn = np.tile(angles, len(patches))
    return corners.assign(
        x=corners["x"] + corners["radius_m"] * np.cos(turn),
        y=corners["y"] + corners["radius_m"] * np.sin(turn),
    )
