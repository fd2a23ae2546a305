"""Courses of measures over births: runs, their mean, and its interval."""

import re
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import plotnine as p9
import pyarrow as pa
import pyarrow.compute as pc

from analysis.comparison.progression import mean_of_all_runs, run_means
from analysis.figures.forms import (
    FITNESS,
    SUMMARY_RUNS,
    NothingToDraw,
    Tables,
    counted_runs,
    fitness_note,
    fitness_panels,
    fitness_text,
)
from analysis.figures.look import GREY
from analysis.figures.style import (
    in_order,
    label,
    lone_points,
    panel_grid,
    scales,
    theme_of_size,
)
from analysis.measures.fitness_functions import MEASURE_UNITS

_FEW_RUNS = 10
"""Runs of an experiment up to which each is drawn."""
_MOST_POINTS = 300
"""Points of a run that are drawn; more cannot be told apart."""
_CHANGES = {
    "body_change": "body: tree edit distance [edits]",
    "brain_change": "brain: distance [elements]",
}
_BINS = 25
"""Greatest number of points of a line of changes."""
_LEAST = 20
"""Least number of births of such a point."""


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
    """Return the course of a measure, a column of ``populations``.

    Raises:
        NothingToDraw: no run has two populations with a value.
    """
    by_run = run_means(tables["populations"], measure)
    if len(set(by_run["births"].to_pylist())) <= 1:
        raise NothingToDraw(f"no run has {measure} at two numbers of births")
    rows = tables["progression"].filter(pc.field("measure") == measure)
    mean = mean_of_all_runs(rows, by_run)
    runs = by_run.to_pandas().groupby("experiment")
    shared = mean.to_pandas().groupby("experiment")["births"].max().to_dict()
    ends = {
        name: shared.get(name, 0)
        for name, last in runs["births"].max().items()
        if shared.get(name, 0) < last
    }
    return Course(_thinned(by_run), mean, runs["folder"].nunique().to_dict(), ends)


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


def over_births(
    tables: Tables, measure: str, text: str, heights: Sequence[float] | None = None
) -> p9.ggplot:
    """Return a measure of runs, and its mean over them, by number of births.

    ``heights`` are values of what is drawn later, from birth 0 on, in place of the
    single runs; they have one fitness function, and the text has its unit.

    Raises:
        NothingToDraw: no run has two populations with a value.
    """
    shown = course(tables, measure)
    has_functions = measure == FITNESS and heights is None
    functions = fitness_panels(tables) if has_functions else {}
    y_text = fitness_text(tables, text) if has_functions else text

    def frame(rows: pa.Table) -> Any:  # noqa: ANN401 - pandas
        values = rows.to_pandas()
        return values.assign(function=values["experiment"].map(functions))

    runs = frame(shown.by_run)
    mean = frame(shown.mean)
    figure = p9.ggplot(mean, p9.aes("births", "mean"))
    sure = shown.mean.filter(pc.field("runs") >= SUMMARY_RUNS)
    if sure.num_rows:
        ends = p9.aes(ymin="low", ymax="high", fill="experiment")
        # Not in the legend: the interval of some experiments is narrower than a line.
        figure += p9.geom_ribbon(ends, frame(sure), alpha=0.18, show_legend=False)
    figure += _single_runs(runs, shown.sizes) if heights is None else []
    figure += p9.geom_line(p9.aes(colour="experiment"), size=0.9)
    figure += lone_points(mean, ["experiment"])
    figure += _change_marks(tables)
    figure = figure + scales(tables, shown.sizes, is_filled=sure.num_rows > 0)
    figure += p9.expand_limits(y=[0, *(heights or ())])
    figure += p9.expand_limits(x=0) if heights else []
    columns, rows = panel_grid(len(set(functions.values())) or 1, 2)
    if functions:
        figure += p9.facet_wrap("function", scales="free_y", ncol=columns)
    return figure + p9.labs(x="births", y=y_text) + theme_of_size(0.8 + 3.0 * rows)


def _change_marks(tables: Tables) -> list[Any]:
    """Return thin vertical lines where settings change; in arenas at mean births."""
    if not tables.get("changes"):
        return []
    rows = tables["changes"].to_pandas()
    marks = rows.groupby(["experiment", "point"], as_index=False)["births"].mean()
    line = p9.aes(xintercept="births")
    return [p9.geom_vline(line, marks, size=0.3, colour=GREY, alpha=0.6)]


def course_caption(tables: Tables, measure: str) -> str:
    """Return what lines and bands of ``over_births`` show."""
    shown = course(tables, measure)
    sizes = shown.sizes
    if max(sizes.values()) == 1:
        text = "Each line is one run"
    else:
        text = "Thick lines are means over runs"
    texts = [f"{text} ({counted_runs(sizes)})."]
    if any(1 < size <= _FEW_RUNS for size in sizes.values()):
        texts.append("Thin lines are single runs.")
    if max(sizes.values()) >= SUMMARY_RUNS:
        texts.append(
            f"Bands are 95 % intervals of the mean of {SUMMARY_RUNS} or more runs; "
            "that of few runs may reach beyond possible values."
        )
    note = fitness_note(tables) if measure == FITNESS else ""
    if ends := shown.ends:
        where = (f"{ends[name]} births ({label(name)})" for name in in_order(ends))
        line = f"A mean ends where the first of its runs ends: {', '.join(where)}."
        texts.append(line)
    return " ".join(texts) + note


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
        ["experiment", "folder", "births"], list(_CHANGES), "panel", "value"
    )
    stacked["panel"] = stacked["panel"].map(_CHANGES)
    runs = _mean(stacked, ["experiment", "folder", "panel", "births"])
    means = _mean(runs, ["experiment", "panel", "births"])
    sizes = runs.groupby("experiment")["folder"].nunique().to_dict()
    columns, lines = panel_grid(len(_CHANGES), 2)
    return (
        p9.ggplot(means, p9.aes("births", "value", colour="experiment"))
        + _single_runs(runs, sizes)
        + p9.geom_line(size=0.9)
        + lone_points(means, ["experiment", "panel"])
        + p9.facet_wrap("panel", scales="free_y", ncol=columns)
        + scales(tables, sizes, is_filled=False)
        + p9.expand_limits(y=0)
        + p9.labs(x=f"births (means over {width})", y="change")
        + theme_of_size(0.4 + 3.0 * lines)
    )


def _single_runs(runs: Any, sizes: Mapping[str, int]) -> list[Any]:  # noqa: ANN401 - pandas
    """Return a layer of the runs of experiments that have a few; by numbers of runs."""
    few = [name for name, size in sizes.items() if 1 < size <= _FEW_RUNS]
    lines = p9.aes(colour="experiment", group="folder")
    chosen = runs[runs["experiment"].isin(few)]
    thin = p9.geom_line(lines, chosen, size=0.35, alpha=0.6, show_legend=False)
    return [thin] if few else []


def _mean(rows: Any, keys: list[str]) -> Any:  # noqa: ANN401 - pandas
    return rows.groupby(keys, as_index=False)["value"].mean()


def measures_over_births(tables: Tables) -> p9.ggplot:
    """Return the mean of each measure over births, a line per run and island."""
    frame = tables["named_measures"].to_pandas()
    frame["line"] = frame["folder"] + " " + frame["island"].astype(str)
    experiments = in_order(frame["experiment"])
    frame["measure"] = list(map(with_unit, frame["measure"], frame["about"]))
    columns, lines = panel_grid(frame["measure"].nunique(), 3)
    return (
        p9.ggplot(frame, p9.aes("births", "mean"))
        + p9.geom_line(p9.aes(colour="experiment", group="line"), size=0.6, alpha=0.8)
        + lone_points(frame, ["experiment", "line", "measure"])
        + p9.facet_wrap("measure", ncol=columns, scales="free_y")
        + scales(tables, experiments, is_filled=False)
        + p9.labs(x="births on the island", y="mean of the population")
        + theme_of_size(1.0 + 2.0 * lines)
    )


def with_unit(measure: str, about: str = "") -> str:
    """Return a measure's name and unit, of an own one the last of its docstring."""
    *_, unit = [MEASURE_UNITS.get(measure, ""), *re.findall(r"\[([^][]+)\]", about)]
    return f"{measure} [{unit}]" if unit else measure
