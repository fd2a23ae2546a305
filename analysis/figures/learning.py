"""Figures of lifetime learning: learning curves, gain over births, bodies saved."""

from typing import Any

import plotnine as p9

from analysis.figures.forms import NothingToDraw, Tables, fitness_text
from analysis.figures.look import BLUE, ORANGE, VERMILION
from analysis.figures.style import (
    in_order,
    label,
    ordered,
    panel_grid,
    scales,
    theme_of_size,
)

_BINS, _WIDTH = 20, 10
"""Most intervals of births of a figure, and their least length."""
_BEFORE_AFTER = [VERMILION, BLUE]
_KEPT, _SAVED = "also with the brain at birth", "saved by learning"


def learning_curves(tables: Tables) -> p9.ggplot:
    """Return the best fitness so far by trial: median and quartiles over robots.

    Raises:
        NothingToDraw: no experiment has two trials.
    """
    groups = tables["learning_curves"].to_pandas().groupby(["experiment", "trial"])
    mean = groups[["median", "low", "high"]].mean().reset_index()
    mean = _in_lines(mean, "trial", "two trials")
    return (
        p9.ggplot(mean, p9.aes("trial"))
        + p9.geom_ribbon(p9.aes(ymin="low", ymax="high", fill="experiment"), alpha=0.25)
        + p9.geom_line(p9.aes(y="median", colour="experiment"), size=0.9)
        + scales(tables, mean["experiment"])
        + p9.expand_limits(y=0)
        + p9.labs(
            x="trial (0: the brain at birth)",
            y=fitness_text(tables, "best fitness so far"),
        )
        + theme_of_size(3.6)
    )


def _binned(frame: Any) -> Any:  # noqa: ANN401 - pandas
    """Return robots with the middle of their bin of births, equal for all runs."""
    width = max(_WIDTH, -(-(int(frame["birth"].max()) + 1) // _BINS))
    middle = (frame["birth"] // width + 0.5) * width
    return frame.assign(births=middle, width=width)


def learning_gain(tables: Tables) -> p9.ggplot:
    """Return the fitness at birth and after learning over births: medians of bins.

    Raises:
        NothingToDraw: no experiment has births in two intervals.
    """
    frame = _binned(tables["learning"].to_pandas())
    texts = {"at_birth": "with the brain at birth", "fitness": "after learning"}
    long = frame.melt(
        ["experiment", "births"], [*texts], var_name="when", value_name="value"
    )
    long["when"] = ordered(long["when"].map(texts), [*texts.values()][::-1])
    grouped = long.groupby(["experiment", "births", "when"], observed=True)["value"]
    quartiles = grouped.quantile([0.25, 0.5, 0.75]).unstack().reset_index()
    quartiles.columns = ["experiment", "births", "when", "low", "median", "high"]
    quartiles = _in_lines(quartiles, "births", f"births in two intervals of {_WIDTH}")
    return (
        p9.ggplot(quartiles, p9.aes("births", "median", fill="when", colour="when"))
        + p9.geom_ribbon(p9.aes(ymin="low", ymax="high"), alpha=0.25, colour="none")
        + p9.geom_line(size=0.9)
        + p9.scale_fill_manual(_BEFORE_AFTER, name="")
        + p9.scale_colour_manual(_BEFORE_AFTER, name="")
        + p9.expand_limits(y=0)
        + p9.labs(x="births", y=fitness_text(tables, "fitness of newborns"))
        + _panels(quartiles)
    )


def bodies_saved(tables: Tables) -> p9.ggplot:
    """Return the shares of newborns that were kept, and of those saved, over births.

    Raises:
        NothingToDraw: no robot that learns was born after the founders.
    """
    frame = tables["learning"].to_pandas()
    frame = frame[frame["kept"].notna()]
    if frame.empty:
        raise NothingToDraw("no robot that learns was born after the founders")
    frame = _binned(frame)
    saved = frame["saved"].astype(float)
    kept = frame["kept"].astype(float) - saved
    frame = frame.assign(**{_SAVED: saved, _KEPT: kept})
    keys = ["experiment", "births", "width"]
    shares = frame.groupby(keys, as_index=False)[[_KEPT, _SAVED]].mean()
    long = shares.melt(keys, var_name="how")
    long["how"] = ordered(long["how"], [_SAVED, _KEPT])
    return (
        p9.ggplot(long, p9.aes("births", "value", fill="how"))
        + p9.geom_col(p9.aes(width="width"), colour="white", size=0.3)
        + p9.scale_fill_manual([ORANGE, "#7F9FBF"], name="")
        + p9.expand_limits(y=[0, 1])
        + p9.labs(x="births", y="share in the next population")
        + _panels(shares)
    )


def _in_lines(frame: Any, along: str, needed: str) -> Any:  # noqa: ANN401 - pandas
    """Return the rows of experiments with two points of a line at least."""
    points = frame.groupby("experiment")[along].transform("nunique")
    lines = frame[points > 1]
    if lines.empty:
        raise NothingToDraw(f"no experiment with learning has {needed}")
    return lines


def _panels(frame: Any) -> list[Any]:  # noqa: ANN401 - pandas
    """Return theme and panels of a figure: a panel for each experiment, if several."""
    names = {name: label(name) for name in in_order(frame["experiment"])}
    if len(names) == 1:
        return [theme_of_size(3.6)]
    columns, rows = panel_grid(len(names), 2)
    panels = p9.facet_wrap("experiment", ncol=columns, labeller=p9.as_labeller(names))
    return [theme_of_size(1.2 + 2.4 * rows), panels]
