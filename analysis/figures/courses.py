"""Courses of measures over births: runs, their mean, and its interval."""

from collections.abc import Mapping
from typing import Any, NamedTuple

import plotnine as p9
import pyarrow as pa
import pyarrow.compute as pc

from analysis.comparison.progression import mean_of_all_runs, run_means
from analysis.figures.forms import (
    BAND_RUNS,
    FITNESS,
    NothingToDraw,
    Tables,
    counted_runs,
    fitness_note,
    fitness_panels,
    fitness_text,
)
from analysis.figures.style import (
    in_order,
    label,
    lone_points,
    scales,
    theme_of_size,
)

FEW_RUNS = 10
"""Runs of an experiment up to which each is drawn."""
_NARROW = 2
"""Panels in a row."""
_MOST_POINTS = 300
"""Points of a run that are drawn; more cannot be told apart."""


class Course(NamedTuple):
    """A measure over births.

    Attributes:
        by_run: as ``progression.run_means``, with at most ``_MOST_POINTS`` of a run.
        mean: rows of ``progression`` at which all runs of an experiment have a value.
        sizes: number of runs of each experiment.
        ends: births at which the mean ends, of experiments with a run that goes on.
    """

    by_run: pa.Table
    mean: pa.Table
    sizes: dict[str, int]
    ends: dict[str, int]


def course(tables: Tables, measure: str) -> Course:
    """Return the course of a measure.

    Args:
        tables: ``populations`` and ``progression``.
        measure: column of ``populations``.

    Raises:
        NothingToDraw: no run has two populations with a value.
    """
    by_run = run_means(tables["populations"], measure)
    if len(set(by_run["births"].to_pylist())) <= 1:
        raise NothingToDraw(f"no run has {measure} at two numbers of births")
    rows = tables["progression"].filter(pc.field("measure") == measure)
    mean = mean_of_all_runs(rows, by_run)
    lasts = _grouped(by_run, [("births", "max"), ("folder", "count_distinct")])
    sizes = {name: row["folder_count_distinct"] for name, row in lasts.items()}
    shared = {
        name: row["births_max"]
        for name, row in _grouped(mean, [("births", "max")]).items()
    }
    ends = {
        name: shared.get(name, 0)
        for name, row in lasts.items()
        if shared.get(name, 0) < row["births_max"]
    }
    return Course(_thinned(by_run), mean, sizes, ends)


def _grouped(table: pa.Table, totals: list[Any]) -> dict[str, dict[str, int]]:
    rows = table.group_by("experiment", use_threads=False).aggregate(totals)
    return {row["experiment"]: row for row in rows.to_pylist()}


def _thinned(by_run: pa.Table) -> pa.Table:
    """Return evenly spaced rows of each run, its first and last included."""
    rows: dict[str, list[int]] = {}
    for row, folder in enumerate(by_run["folder"].to_pylist()):
        rows.setdefault(folder, []).append(row)
    kept = []
    for mine in rows.values():
        step = -(-len(mine) // _MOST_POINTS)
        kept += [*mine[:-1:step], mine[-1]]
    return by_run.take(pa.array(kept, pa.int64()))


def over_births(tables: Tables, measure: str, text: str) -> p9.ggplot:
    """Return a measure of runs, and its mean over them, by number of births.

    Args:
        tables: ``populations`` and ``progression``; ``runs`` for the panels of
            fitness functions.
        measure: column of ``populations``.
        text: label of the axis.

    Raises:
        NothingToDraw: no run has two populations with a value.
    """
    shown = course(tables, measure)
    functions = fitness_panels(tables) if measure == FITNESS else {}

    y_text = fitness_text(tables, text) if measure == FITNESS else text

    def frame(rows: pa.Table) -> Any:  # noqa: ANN401 - pandas
        made = rows.to_pandas()
        return made.assign(function=made["experiment"].map(functions))

    runs = frame(shown.by_run)
    few = [name for name, size in shown.sizes.items() if 1 < size <= FEW_RUNS]
    mean = frame(shown.mean)
    figure = p9.ggplot(mean, p9.aes("births", "mean"))
    sure = shown.mean.filter(pc.field("runs") >= BAND_RUNS)
    if sure.num_rows:
        ends = p9.aes(ymin="low", ymax="high", fill="experiment")
        # Not in the legend: the interval of some experiments is narrower than a line.
        figure += p9.geom_ribbon(ends, frame(sure), alpha=0.18, show_legend=False)
    if few:
        figure += p9.geom_line(
            p9.aes(colour="experiment", group="folder"),
            data=runs[runs["experiment"].isin(few)],
            size=0.35,
            alpha=0.6,
            show_legend=False,
        )
    figure += p9.geom_line(p9.aes(colour="experiment"), size=0.9)
    figure += lone_points(mean, ["experiment"])
    figure = figure + scales(tables, shown.sizes, is_filled=sure.num_rows > 0)
    figure += p9.expand_limits(y=0)
    if functions:
        figure += p9.facet_wrap("function", scales="free_y", ncol=_NARROW)
    rows = -(-len(set(functions.values())) // _NARROW) or 1
    return figure + p9.labs(x="births", y=y_text) + theme_of_size(0.8 + 3.0 * rows)


def course_caption(tables: Tables, measure: str) -> str:
    """Return what lines and bands of ``over_births`` show."""
    shown = course(tables, measure)
    sizes = shown.sizes
    if max(sizes.values()) == 1:
        text = "Each line is one run"
    else:
        text = "Thick lines are means over runs"
    texts = [f"{text} ({counted_runs(sizes)})."]
    if any(1 < size <= FEW_RUNS for size in sizes.values()):
        texts.append("Thin lines are single runs.")
    if max(sizes.values()) >= BAND_RUNS:
        texts.append(
            f"Bands are 95 % intervals of the mean of {BAND_RUNS} or more runs; that "
            "of few runs may reach beyond possible values."
        )
    note = fitness_note(tables) if measure == FITNESS else ""
    return " ".join([*texts, *_ends(shown.ends)]) + note


def _ends(ends: Mapping[str, int]) -> list[str]:
    """Return where means end although a run goes on."""
    if not ends:
        return []
    where = ", ".join(f"{ends[name]} births ({label(name)})" for name in in_order(ends))
    return [f"A mean ends where the first of its runs ends: {where}."]
