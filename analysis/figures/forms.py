"""Distributions of measures over runs: points, boxes and violins."""

from collections.abc import Mapping, Sequence
from textwrap import fill
from typing import Any

import plotnine as p9
import pyarrow as pa
import pyarrow.compute as pc

from analysis.figures.look import INK, LOOK
from analysis.figures.style import (
    in_order,
    label,
    ordered,
    panel_grid,
    scales,
    text_in,
    theme_of_size,
    two_line_label,
)
from analysis.measures.fitness_functions import (
    axis_text,
    fitness_unit,
    functions_of,
)
from schema.errors import RevolveError

Tables = Mapping[str, pa.Table]
"""Measures by name, with the columns of ``outputs``."""

Row = Mapping[str, Any]
"""Row of one of these tables."""

Panels = Mapping[str, str]
"""Text of the axis or heading of each measure of a figure."""

SUMMARY_RUNS = 5
"""Runs from which on boxes, and intervals of means as bands and bars, are drawn.

The interval of the mean of five normal runs is as wide as their range is on average
(2.5 and 2.3 standard deviations); that of four is half as wide again (3.2 and 2.1), of
three three times as wide (5.0 and 1.7): a band that says less than the runs themselves.
"""
_NARROW = 3
"""Panels in a row."""
_BESIDE_IN = 0.7
"""Space beside a panel [inches]."""
_TITLE = 28
"""Characters of a line of a panel's title."""

FITNESS = "fitness"
"""Measure whose figures have a panel for each fitness function."""


class NothingToDraw(RevolveError):  # noqa: N818 - a result, not a failure
    """The tables lack the data of a figure; the message says what is missing."""


def fitness_panels(tables: Tables) -> dict[str, str]:
    """Return titles of panels, the functions, by experiment; empty for one function.

    Values of different functions must not share an axis.
    """
    functions = _functions(tables)
    if len(set(functions.values())) <= 1:
        return {}
    return {name: fill(text, _TITLE) for name, text in functions.items()}


def _functions(tables: Tables) -> dict[str, str]:
    return functions_of(tables["runs"]) if "runs" in tables else {}


def fitness_text(tables: Tables, text: str) -> str:
    """Return the label of an axis of fitness, with the unit if all runs share one."""
    names = set(_functions(tables).values())
    return axis_text(names.pop(), text) if len(names) == 1 else text


def fitness_units(tables: Tables) -> dict[str, str]:
    """Return the unit of each experiment's fitness; empty where it is not known."""
    return {name: fitness_unit(text) for name, text in _functions(tables).items()}


def fitness_note(tables: Tables) -> str:
    """Return a sentence about the panels of fitness functions; empty for one."""
    if not fitness_panels(tables):
        return ""
    return (
        " Each fitness function has its own panel; values of different functions "
        "cannot be compared."
    )


def over_runs(tables: Tables, panels: Panels) -> p9.ggplot:
    """Return the distributions of measures over runs at the end, by experiment.

    Each point is a run. A box summarises five or more runs, a bar shows the median of
    fewer. Pale violins show the robots of the last populations at the same births.

    Raises:
        NothingToDraw: no finished run has a value.
    """
    if not tables["outcomes"].num_rows:
        raise NothingToDraw("no finished run could be measured")
    functions = fitness_panels(tables) if FITNESS in panels else {}
    runs = _by_function(stacked(tables["outcomes"], panels), functions)
    if runs.empty:
        raise NothingToDraw(f"no finished run has a value of {next(iter(panels))}")
    experiments = in_order(runs["experiment"])
    figure = p9.ggplot(runs, p9.aes("experiment", "value"))
    figure += [*_violins(tables, panels, functions, experiments), *_summaries(runs)]
    figure = figure + scales(tables, experiments) + p9.expand_limits(y=0)
    # An invisible layer extends panels of zeros from 0 to 1.
    flat = runs[runs.groupby("panel", observed=True)["value"].transform("max") == 0]
    if not flat.empty:
        figure += p9.geom_blank(data=flat.assign(value=1.0))
    figure += p9.geom_point(
        p9.aes(fill="experiment"),
        position=p9.position_jitter(width=0.06, height=0, random_state=1),
        size=1.8,
        colour=INK,
        stroke=0.3,
        show_legend=len(panels) > 1,
    )
    births = _births(tables["outcomes"], experiments)
    if len(panels) > 1:
        return figure + _in_panels(len(panels), experiments, births)
    labels = {
        name: f"{two_line_label(name)}\n{births.get(name, '')}".rstrip()
        for name in experiments
    }
    look = theme_of_size(3.6) + p9.theme(legend_position="none")
    if functions:
        columns, rows = panel_grid(runs["panel"].nunique(), _NARROW)
        figure += p9.facet_wrap("panel", scales="free", ncol=columns)
        figure += p9.scale_x_discrete(labels=labels)
        look = theme_of_size(0.6 + 3.0 * rows) + p9.theme(legend_position="none")
    else:
        figure += p9.scale_x_discrete(limits=experiments, labels=list(labels.values()))
    measure, text = next(iter(panels.items()))
    y_text = fitness_text(tables, text) if measure == FITNESS else text
    if sum(map(text_in, labels.values())) > LOOK.get().width_in - _BESIDE_IN:
        look += p9.theme(axis_text_x=p9.element_text(rotation=40, ha="right"))
    return figure + p9.labs(x="", y=y_text) + look


def columns_of(
    experiments: Sequence[str], heights: Sequence[float], y_text: str
) -> p9.ggplot:
    """Return axes with a place for each experiment, at 0, 1 and so on, for heights."""
    places = range(len(experiments))
    labels = list(map(two_line_label, experiments))
    look = theme_of_size(3.6)
    if sum(map(text_in, labels)) > LOOK.get().width_in - _BESIDE_IN:
        look += p9.theme(axis_text_x=p9.element_text(rotation=40, ha="right"))
    return (
        p9.ggplot()
        + p9.expand_limits(x=[-0.5, len(places) - 0.5])
        + p9.expand_limits(y=[0, *heights])
        + p9.scale_x_continuous(breaks=places, labels=labels, minor_breaks=[])
        + p9.labs(x="", y=y_text)
        + look
    )


def _by_function(rows: Any, functions: Mapping[str, str]) -> Any:  # noqa: ANN401 - pandas
    """Return rows of ``stacked`` whose panels are the fitness functions, if several."""
    if not functions:
        return rows
    return rows.assign(panel=rows["experiment"].map(functions))


def spread_caption(tables: Tables, panels: Panels, note: str = "") -> str:
    """Return what points, boxes, bars and violins of ``over_runs`` show, and a note."""
    runs = stacked(tables["outcomes"], panels)
    known = runs[runs["panel"] == next(iter(panels.values()))]
    sizes = known.groupby("experiment", observed=True).size().to_dict()
    births = set(tables["outcomes"]["births"].to_pylist())
    at = f", at {births.pop()} births" if len(births) == 1 else ""
    texts = [f"Each point is a finished run ({counted_runs(sizes)}){at}."]
    if max(sizes.values(), default=0) >= SUMMARY_RUNS:
        texts.append(
            "Boxes show median and quartiles, whiskers the values within 1.5 times "
            "the height of the box."
        )
    if min(sizes.values(), default=SUMMARY_RUNS) < SUMMARY_RUNS:
        texts.append(f"With fewer than {SUMMARY_RUNS} runs a bar shows their median.")
    if _violins(tables, panels, {}, in_order(sizes)):
        texts.append(
            "Pale shapes show the robots of the last populations at those births, each "
            "once, from the least to the greatest value."
        )
    texts += [note] if note else []
    return " ".join(texts) + (fitness_note(tables) if FITNESS in panels else "")


def counted_runs(sizes: Mapping[str, int]) -> str:
    """Return the number of runs of each experiment as text."""
    names = in_order(sizes)
    if len(set(sizes.values())) == 1 and len(names) > _NARROW:
        count = sizes[names[0]]
        return f"{count} run{'s' * (count > 1)} of each experiment"
    counts = [f"{sizes[name]} of {label(name)}" for name in names]
    return ", ".join(counts)


def _births(outcomes: pa.Table, experiments: list[str]) -> dict[str, str]:
    rows = outcomes.select(["experiment", "births"]).to_pylist()
    known = {row["experiment"]: f"{row['births']} births" for row in rows}
    texts = {name: known[name] for name in experiments}
    return texts if len(set(texts.values())) > 1 else {}


def _in_panels(count: int, experiments: list[str], births: dict[str, str]) -> list[Any]:
    """Return the facets of several panels; the axis label holds different births."""
    at = [
        f"{text}: {', '.join(label(name) for name in births if births[name] == text)}"
        for text in dict.fromkeys(births.values())
    ]
    columns, rows = panel_grid(count, _NARROW)
    return [
        p9.scale_x_discrete(limits=experiments),
        p9.facet_wrap("panel", scales="free_y", ncol=columns),
        p9.labs(x="; ".join(at), y=""),
        theme_of_size(0.8 + 2.6 * rows),
        p9.theme(
            axis_text_x=p9.element_blank(),
            axis_ticks_major_x=p9.element_blank(),
            axis_title_x=p9.element_text(size=8),
        ),
    ]


def stacked(table: pa.Table, panels: Panels) -> Any:  # noqa: ANN401 - pandas
    """Return the values of the panels' measures: experiment, panel in order, value.

    Nulls are ignored.
    """
    known = [measure for measure in panels if measure in table.column_names]
    frame = table.select(["experiment", *known]).to_pandas()
    rows = frame.melt("experiment", known, "panel").dropna(subset="value")
    titles = ordered(rows["panel"].map(dict(panels)), panels.values())
    return rows.assign(panel=titles, value=rows["value"].astype(float))


def _grouped(rows: Any) -> Any:  # noqa: ANN401 - pandas
    groups = rows.groupby(["experiment", "panel"], observed=True, as_index=False)
    return groups["value"]


def _violins(
    tables: Tables, panels: Panels, functions: Mapping[str, str], experiments: list[str]
) -> list[Any]:
    """Return a layer of the robots of last populations, if they have the measures."""
    robots = tables.get("robots")
    if robots is None or not panels.keys() & set(robots.column_names):
        return []
    rows = _by_function(stacked(_last_robots(tables), panels), functions)
    rows = rows[rows["experiment"].isin(experiments)]
    values = _grouped(rows)
    # A distribution of equal values has no shape.
    varied = rows[values.transform("max") > values.transform("min")]
    if varied.empty:
        return []
    return [
        p9.geom_violin(
            p9.aes(fill="experiment"),
            data=varied,
            colour="none",
            alpha=0.3,
            scale="width",
            width=0.85,
        )
    ]


def _last_robots(tables: Tables) -> pa.Table:
    """Return the robots of last populations at the births of their run's outcomes.

    Runs that are unfinished or longer than the others have other last populations, and
    so have islands with more births than another one of their run.
    """
    robots = tables["robots"].filter(pc.field("is_last"))
    populations = tables.get("populations")
    if populations is None or "folder" not in robots.column_names:
        return robots
    keys = ["folder", "island"]
    ends = populations.group_by(keys).aggregate([("births", "max")])
    runs = tables["outcomes"].select(["folder", "births"])
    ended = ends.join(runs, "folder", join_type="inner")
    equal = ended.filter(pc.field("births_max") <= pc.field("births"))
    return robots.join(equal.select(keys), keys, join_type="left semi")


def _summaries(runs: Any) -> list[Any]:  # noqa: ANN401 - pandas
    """Return layers that summarise runs: boxes of many, medians of few."""
    sizes = _grouped(runs).transform("size")
    many, few = runs[sizes >= SUMMARY_RUNS], runs[sizes < SUMMARY_RUNS]
    layers = []
    if not many.empty:
        layers.append(
            p9.geom_boxplot(
                p9.aes(colour="experiment"),
                data=many,
                width=0.3,
                outlier_shape="",
                size=0.7,
                alpha=0,
                show_legend=False,
            )
        )
    if not few.empty:
        layers.append(
            p9.geom_errorbar(
                p9.aes("experiment", ymin="value", ymax="value", colour="experiment"),
                data=_grouped(few).median(),
                inherit_aes=False,
                width=0.45,
                size=1.1,
                show_legend=False,
            )
        )
    return layers
