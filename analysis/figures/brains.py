"""Figure of the changes of bodies and brains from parent to child."""

from typing import Any

import plotnine as p9

from analysis.figures.courses import FEW_RUNS
from analysis.figures.forms import NothingToDraw, Tables
from analysis.figures.style import in_order, lone_points, scales, theme_of_size

_PANELS = {
    "body_change": "body: tree edit distance [edits]",
    "brain_change": "brain: distance [elements]",
}
_BINS = 25
"""Greatest number of points of a line."""
_LEAST = 20
"""Least number of births of a point."""


def changes_over_births(tables: Tables) -> p9.ggplot:
    """Return the change of bodies and of brains from the first parent to its child.

    Raises:
        NothingToDraw: no robot has a parent.
    """
    known = tables["brains"].filter(tables["brains"]["body_change"].is_valid())
    if not known:
        raise NothingToDraw("no robot has parents")
    rows = known.to_pandas()
    width = max(int(rows["birth"].max()) // _BINS + 1, _LEAST)
    rows["births"] = rows.groupby(rows["birth"] // width)["birth"].transform("mean")
    stacked = rows.melt(
        ["experiment", "folder", "births"], list(_PANELS), "panel", "value"
    )
    stacked["panel"] = stacked["panel"].map(_PANELS)
    runs = _mean(stacked, ["experiment", "folder", "panel", "births"])
    means = _mean(runs, ["experiment", "panel", "births"])
    sizes = runs.groupby("experiment")["folder"].nunique()
    few = sizes[(sizes > 1) & (sizes <= FEW_RUNS)].index
    figure = p9.ggplot(means, p9.aes("births", "value", colour="experiment"))
    if len(few):
        figure += p9.geom_line(
            p9.aes(group="folder"),
            data=runs[runs["experiment"].isin(few)],
            size=0.35,
            alpha=0.6,
        )
    return (
        figure
        + p9.geom_line(size=0.9)
        + lone_points(means, ["experiment", "panel"])
        + p9.facet_wrap("panel", scales="free_y", ncol=2)
        + scales(tables, in_order(sizes.index), is_filled=False)
        + p9.expand_limits(y=0)
        + p9.labs(x=f"births (means over {width})", y="change")
        + theme_of_size(3.4)
    )


def _mean(rows: Any, keys: list[str]) -> Any:  # noqa: ANN401 - pandas
    """Return the mean value of each group."""
    return rows.groupby(keys, as_index=False)["value"].mean()
