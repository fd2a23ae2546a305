"""Plots of the thesis: distributions over runs, and progress over births."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import plotnine as p9
import pyarrow as pa
import pyarrow.compute as pc

from analysis.figures.style import (
    in_order,
    label,
    scales,
    theme_of_size,
    two_line_label,
)
from schema.errors import RevolveError

Tables = Mapping[str, pa.Table]
"""Measures by name, with the columns of ``outputs``."""

BOX_RUNS = 5
"""Runs from which on a box is drawn."""
BAND_RUNS = 3
"""Runs from which on a mean's interval is drawn: that of two runs is 9 times wider."""
_NARROW = 3
"""Panels in a row."""
_INK = "#333333"


class NothingToDraw(RevolveError):  # noqa: N818 - a result, not a failure
    """The tables lack the data of a figure; the message says what is missing."""


@dataclass(frozen=True, slots=True)
class Panel:
    """One measure of a figure: its column, and the text of its axis or heading."""

    measure: str
    text: str


def over_runs(tables: Tables, *panels: Panel) -> p9.ggplot:
    """Return the distributions of measures over runs at the end, by experiment.

    Each point is a run. A box summarises five or more runs, a bar shows the median of
    fewer. Pale violins show the robots of all last populations.

    Args:
        tables: ``outcomes``, and ``robots`` if they have the measure.
        panels: the measures.

    Raises:
        NothingToDraw: no finished run has a value.
    """
    if not tables["outcomes"].num_rows:
        raise NothingToDraw("no finished run could be measured")
    runs = stacked(tables["outcomes"], panels)
    if not runs.num_rows:
        raise NothingToDraw(f"no finished run has a value of {panels[0].measure}")
    experiments = in_order(runs["experiment"].to_pylist())
    figure = p9.ggplot(_frame(runs, panels), p9.aes("experiment", "value"))
    violins = _violins(tables, panels, experiments)
    for layer in (*violins, *_summaries(runs, panels)):
        figure += layer
    figure = figure + scales(experiments) + p9.expand_limits(y=0)
    figure += _unit_height(runs, panels)
    figure += p9.geom_point(
        p9.aes(fill="experiment"),
        position=p9.position_jitter(width=0.06, height=0, random_state=1),
        size=1.8,
        colour=_INK,
        stroke=0.3,
        show_legend=False,
    )
    births = _births(tables["outcomes"], experiments)
    if len(panels) > 1:
        return figure + _in_panels(len(panels), experiments, births)
    labels = [
        f"{two_line_label(name)}\n{births[name]}" if births else two_line_label(name)
        for name in experiments
    ]
    figure += p9.scale_x_discrete(limits=experiments, labels=labels)
    look = theme_of_size(3.6) + p9.theme(legend_position="none")
    return figure + p9.labs(x="", y=panels[0].text) + look


def _unit_height(runs: pa.Table, panels: Sequence[Panel]) -> list[Any]:
    """Return an invisible layer that extends panels of zeros from 0 to 1."""
    greatest = runs.group_by("panel").aggregate([("value", "max")])
    flat = greatest.filter(pc.equal(greatest["value_max"], 0.0))["panel"]
    empty = runs.filter(pc.is_in(runs["panel"], flat.combine_chunks()))
    if not empty.num_rows:
        return []
    ones = pa.repeat(pa.scalar(1.0), empty.num_rows)
    unseen = replace_column(empty, "value", ones)
    return [p9.geom_blank(data=_frame(unseen, panels))]


def replace_column(table: pa.Table, name: str, column: Any) -> pa.Table:  # noqa: ANN401 - untyped
    """Return a table with another column in the place of one."""
    return table.set_column(table.schema.get_field_index(name), name, column)


def _births(outcomes: pa.Table, experiments: list[str]) -> dict[str, str]:
    """Return the births of each experiment's outcomes, empty if they are equal."""
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
    return [
        p9.scale_x_discrete(limits=experiments),
        p9.facet_wrap("panel", scales="free_y", ncol=min(count, _NARROW)),
        p9.labs(x="; ".join(at), y=""),
        theme_of_size(3.4 if count <= _NARROW else 6.0),
        p9.theme(
            axis_text_x=p9.element_blank(),
            axis_ticks_major_x=p9.element_blank(),
            axis_title_x=p9.element_text(size=8),
        ),
    ]


def stacked(table: pa.Table, panels: Sequence[Panel]) -> pa.Table:
    """Return ``experiment``, ``panel`` (its text) and ``value``, one row per value."""
    pieces = []
    for panel in panels:
        known = table.filter(table[panel.measure].is_valid())
        pieces.append(
            pa.table(
                {
                    "experiment": known["experiment"],
                    "panel": pa.repeat(pa.scalar(panel.text), known.num_rows),
                    "value": known[panel.measure].cast(pa.float64()),
                }
            )
        )
    return pa.concat_tables(pieces)


def _frame(rows: pa.Table, panels: Sequence[Panel]) -> Any:  # noqa: ANN401 - pandas
    """Return rows for plotnine, panels in their order."""
    texts = [panel.text for panel in panels]
    index = pc.index_in(rows["panel"], pa.array(texts)).combine_chunks()
    ordered = pa.DictionaryArray.from_arrays(index, texts)
    return replace_column(rows, "panel", ordered).to_pandas()


def _groups(rows: pa.Table) -> Iterator[pa.Table]:
    """Yield the rows of each experiment and panel."""
    keys = rows.select(["experiment", "panel"]).group_by(["experiment", "panel"])
    for key in keys.aggregate([]).to_pylist():
        is_here = pc.and_(
            pc.equal(rows["experiment"], key["experiment"]),
            pc.equal(rows["panel"], key["panel"]),
        )
        yield rows.filter(is_here)


def _violins(
    tables: Tables, panels: Sequence[Panel], experiments: list[str]
) -> list[Any]:
    """Return a layer of the robots of last populations, if they have the measures."""
    if "robots" not in tables:
        return []
    robots = tables["robots"].filter(pc.field("is_last"))
    shown = [panel for panel in panels if panel.measure in robots.column_names]
    if not shown:
        return []
    # A distribution of equal values has no shape.
    varied = [
        group
        for group in _groups(stacked(robots, shown))
        if np.ptp(np.asarray(group["value"])) > 0
        and group["experiment"][0].as_py() in experiments
    ]
    if not varied:
        return []
    return [
        p9.geom_violin(
            p9.aes(fill="experiment"),
            data=_frame(pa.concat_tables(varied), panels),
            colour="none",
            alpha=0.3,
            scale="width",
            width=0.85,
        )
    ]


def _summaries(runs: pa.Table, panels: Sequence[Panel]) -> list[Any]:
    """Return layers that summarise runs: boxes of many, medians of few."""
    groups = list(_groups(runs))
    many = [group for group in groups if group.num_rows >= BOX_RUNS]
    few = [_median(group) for group in groups if group.num_rows < BOX_RUNS]
    layers = []
    if many:
        layers.append(
            p9.geom_boxplot(
                p9.aes(colour="experiment"),
                data=_frame(pa.concat_tables(many), panels),
                width=0.3,
                outlier_shape="",
                size=0.7,
                alpha=0,
                show_legend=False,
            )
        )
    if few:
        layers.append(
            p9.geom_errorbar(
                p9.aes("experiment", ymin="value", ymax="value", colour="experiment"),
                data=_frame(pa.concat_tables(few), panels),
                inherit_aes=False,
                width=0.45,
                size=1.1,
                show_legend=False,
            )
        )
    return layers


def _median(group: pa.Table) -> pa.Table:
    middle = float(np.median(np.asarray(group["value"])))
    return group.slice(0, 1).set_column(2, "value", [[middle]])


def over_births(tables: Tables, measure: str, text: str) -> p9.ggplot:
    """Return the mean of a measure over runs, by number of births.

    Args:
        tables: ``progression``.
        measure: column of ``populations``.
        text: label of the axis.

    Raises:
        NothingToDraw: no run has two populations with a value.
    """
    table = tables["progression"].filter(pc.field("measure") == measure)
    if len(set(table["births"].to_pylist())) <= 1:
        raise NothingToDraw(f"no run has {measure} at two numbers of births")
    figure = p9.ggplot(table.to_pandas(), p9.aes("births", "mean"))
    sure = table.filter(pc.field("runs") >= BAND_RUNS)
    if sure.num_rows:
        ends = p9.aes(ymin="low", ymax="high", fill="experiment")
        band = replace_column(sure, "low", pc.max_element_wise(sure["low"], 0.0))
        figure += p9.geom_ribbon(ends, data=band.to_pandas(), alpha=0.18)
    figure += p9.geom_line(p9.aes(colour="experiment"), size=0.9)
    names = table["experiment"].to_pylist()
    figure = figure + scales(names, is_filled=sure.num_rows > 0) + theme_of_size(3.8)
    # The interval of few runs may extend far beyond the possible values.
    top = float(pc.max(table["greatest"]).as_py())
    limits = p9.coord_cartesian(ylim=(0, 1.02 * top or 1.0))
    margins = p9.scale_y_continuous(expand=(0.03, 0, 0, 0))
    return figure + limits + margins + p9.labs(x="births", y=text)
