"""Interactive plots of fitness: over births, and of the last populations."""

from collections.abc import Mapping, Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc

from analysis.figures.courses import Course, course
from analysis.figures.forms import SUMMARY_RUNS, NothingToDraw, Row, Tables
from analysis.figures.look import INK
from analysis.figures.style import colours, in_order, label
from analysis.measures.fitness_functions import by_function, functions_of
from analysis.report.html import legend
from analysis.report.plots import Axes, band, dot, line, painted, plot, with_margin
from schema.errors import counted

_MANY_RUNS = 40
"""Runs from which on only the best robot of each is marked."""
_MOST_DOTS = 3000
_NAME, _NAMED = 14, 3
"""Characters of names along an axis, and their number; others are in a legend."""
_COLUMNS = 4
"""Number of runs for which columns have room; fewer runs have no wider ones."""


class RunName(NamedTuple):
    """What identifies a run to a reader."""

    experiment: str
    number: int
    seed: int

    def __str__(self) -> str:
        return f"{label(self.experiment)}, run {self.number}, seed {self.seed}"


def run_names(runs: pa.Table) -> dict[str, RunName]:
    """Return the names of runs by folder."""
    rows = runs.select(["folder", "experiment", "run", "seed"]).to_pylist()
    return {
        row["folder"]: RunName(row["experiment"], row["run"], row["seed"])
        for row in rows
    }


def of_each_function(tables: Tables) -> dict[str, Tables]:
    """Return the tables with the runs of each fitness function, by its name.

    Plots of different functions must not share an axis. The table ``runs`` is complete
    everywhere: it determines the colours.
    """
    groups = by_function(functions_of(tables["runs"]))
    names = ("robots", "populations", "progression")
    return {
        function: {
            **tables,
            **{
                name: tables[name].filter(pc.field("experiment").isin(experiments))
                for name in names
            },
        }
        for function, experiments in groups.items()
    }


def fitness_over_births(tables: Tables, y_text: str = "fitness") -> str:
    """Return the plot of runs, their means, and robots fitter than all before.

    Robots of arenas are at their greatest fitness, because the lines are means of the
    fitness at each birth: at their last fitness they could all be below the lines. It
    is empty if no run has two populations.
    """
    try:
        shown = course(tables, "fitness")
    except NothingToDraw:
        return ""
    islands = tables["runs"]["islands"].to_pylist()
    names = run_names(tables["runs"])
    of_all = [name.experiment for name in names.values()]
    paint = colours(of_all)
    robots = _records(tables["robots"], few=len(names) >= _MANY_RUNS)
    means = shown.mean.to_pylist()
    sure = [row for row in means if row["runs"] >= SUMMARY_RUNS]
    heights = [row[end] for row in sure for end in ("low", "high")]
    heights += shown.by_run["mean"].to_pylist() + robots["fitness_max"].to_pylist()
    last = max(shown.by_run["births"].to_pylist())
    axes = Axes((0.0, float(last)), with_margin(heights))
    marks = [_band(axes, sure, name, paint[name]) for name in in_order(shown.sizes)]
    marks += _runs(axes, shown, names, paint)
    for name in in_order(shown.sizes):
        points = [(r["births"], r["mean"]) for r in means if r["experiment"] == name]
        text = f"{label(name)}: mean of {shown.sizes[name]} runs"
        if len(points) > 1 and shown.sizes[name] > 1:
            mean = line(axes, points, "mean")
            marks.append(painted(paint[name], mean, kind="curve", text=text))
    marks += _dots(axes, robots, names, paint)
    drawn = plot(
        axes,
        marks,
        description="Fitness over births",
        x_text="births on each island" if max(islands) > 1 else "births",
        y_text=y_text,
    )
    return legend(in_order(shown.sizes), of_all) + drawn


def _records(robots: pa.Table, *, few: bool) -> pa.Table:
    """Return the robots that are fitter than all that were born before in their run."""
    keys = ["folder", "births", "birth_island"]
    known = robots.filter(pc.invert(pc.field("is_failed")))
    born = known.sort_by([(key, "ascending") for key in keys])
    fitness = np.asarray(born["fitness_max"], np.float64)
    folders = np.asarray(born["folder"].combine_chunks().dictionary_encode().indices)
    starts = np.flatnonzero(np.diff(folders, prepend=-1))
    kept = []
    for start, end in pairwise([*starts, len(fitness)]):
        best = np.maximum.accumulate(fitness[start:end])
        is_record = np.diff(best, prepend=-np.inf) > 0
        places = start + np.flatnonzero(is_record)
        kept += places[-1:].tolist() if few else places.tolist()
    return born.take(pa.array(kept, pa.int64()))


def _band(axes: Axes, rows: Sequence[Row], name: str, colour: str) -> str:
    mine = [
        (row["births"], row["low"], row["high"])
        for row in rows
        if row["experiment"] == name
    ]
    return painted(colour, band(axes, mine)) if len(mine) > 1 else ""


def _runs(
    axes: Axes, shown: Course, names: Mapping[str, RunName], paint: Mapping[str, str]
) -> list[str]:
    points: dict[str, list[tuple[float, float]]] = {}
    for row in shown.by_run.to_pylist():
        points.setdefault(row["folder"], []).append((row["births"], row["mean"]))
    marks = []
    for folder, mine in points.items():
        name = names[folder]
        births, fitness = mine[-1]
        text = f"{name}\nmean fitness {fitness:.3g} at {births} births"
        kind = "run" if shown.sizes[name.experiment] > 1 else "mean"
        drawn = line(axes, mine, kind)
        marks.append(painted(paint[name.experiment], drawn, kind="curve", text=text))
    return marks


def _dots(
    axes: Axes, robots: pa.Table, names: Mapping[str, RunName], paint: Mapping[str, str]
) -> list[str]:
    marks: dict[str, list[str]] = {}
    for row in robots.to_pylist():
        name = names[row["folder"]]
        births = row["births"]
        described = _described(row, row["fitness_max"])
        text = f"robot {row['birth_island']}:{row['birth']}, {name}\n{described}"
        if births <= axes.x_range[1]:
            place = axes.x(births), axes.y(row["fitness_max"])
            marks.setdefault(name.experiment, []).append(dot(*place, text, 2.6))
    return [painted(paint[name], *marks[name], kind="dots") for name in in_order(marks)]


def _described(row: Row, fitness: float) -> str:
    return (
        f"fitness {fitness:.3g}; {counted(row['parts'], 'part')}, "
        f"{counted(row['active_joints'], 'motor')}, "
        f"{counted(row['hidden'], 'hidden neuron')}"
    )


def last_populations(tables: Tables, y_text: str = "fitness") -> str:
    """Return the plot of all robots of the last populations, a column per run.

    It is empty if no run has a population, or if there are too many robots.
    """
    living = tables["robots"].filter(pc.field("is_last"))
    if not 0 < living.num_rows <= _MOST_DOTS:
        return ""
    names = run_names(tables["runs"])
    paint = colours(name.experiment for name in names.values())
    shown = in_order(living["experiment"].to_pylist())
    axes = Axes((0.0, float(len(shown))), with_margin(living["fitness"].to_pylist()))
    marks = []
    for place, experiment in enumerate(shown):
        mine = living.filter(pc.field("experiment") == experiment)
        marks.append(painted(paint[experiment], *_columns(axes, mine, names, place)))
    is_named = len(shown) <= _NAMED and max(map(len, map(label, shown))) <= _NAME
    ticks = [(place + 0.5, label(name)) for place, name in enumerate(shown)] * is_named
    names_above = "" if is_named else legend(shown, [*paint])
    return names_above + plot(
        axes,
        marks,
        description="Fitness of the last populations",
        x_text="",
        y_text=y_text,
        x_names=ticks,
    )


def _columns(
    axes: Axes, living: pa.Table, names: Mapping[str, RunName], place: int
) -> list[str]:
    """Return a column of robots for each run of an experiment, and the run's mean."""
    by_run: dict[str, list[Row]] = {}
    for row in living.to_pylist():
        by_run.setdefault(row["folder"], []).append(row)
    marks = []
    width = 0.8 / max(len(by_run), _COLUMNS)
    for at, (folder, rows) in enumerate(by_run.items()):
        name = names[folder]
        middle = place + 0.5 + width * (at - 0.5 * (len(by_run) - 1))
        for count, row in enumerate(rows):
            aside = width * 0.6 * ((count * 0.618) % 1 - 0.5)
            text = f"robot {row['birth_island']}:{row['birth']}, {name}"
            spot = axes.x(middle + aside), axes.y(row["fitness"])
            marks.append(dot(*spot, f"{text}\n{_described(row, row['fitness'])}", 2.6))
        mean = float(np.mean([row["fitness"] for row in rows]))
        ends = [(middle - 0.4 * width, mean), (middle + 0.4 * width, mean)]
        text = f"{name}\nmean {mean:.3g} of {len(rows)} robots"
        marks.append(painted(INK, line(axes, ends, "level"), text=text))
    return marks
