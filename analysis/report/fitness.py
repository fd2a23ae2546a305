"""Interactive plots of fitness: over births, and of the last populations."""

from collections.abc import Sequence
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc

from analysis.figures.courses import course, over_births
from analysis.figures.forms import NothingToDraw, Row, Tables, columns_of
from analysis.figures.look import INK
from analysis.figures.style import colours, in_order, label
from analysis.measures.fitness_functions import by_function, functions_of
from analysis.report.interactive import interactive
from schema.errors import counted

_MANY_RUNS = 40
"""Runs from which on only the best robot of each is marked."""
_MOST_DOTS = 3000
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


def fitness_over_births(tables: Tables, y_text: str) -> str:
    """Return the plot of runs, their means, and robots fitter than all before.

    Robots of arenas are at their greatest fitness, because the lines are means of the
    fitness at each birth: at their last fitness they could all be below the lines. It
    is empty if no run has two populations.
    """
    try:
        shown = course(tables, "fitness")
    except NothingToDraw:
        return ""
    names = run_names(tables["runs"])
    paint = colours(name.experiment for name in names.values())
    robots = _records(tables["robots"], few=len(names) >= _MANY_RUNS)
    robots = robots.filter(pc.field("births") <= pc.max(shown.by_run["births"]))
    heights = shown.by_run["mean"].to_pylist() + robots["fitness_max"].to_pylist()
    figure = over_births(tables, "fitness", y_text, heights).draw()
    axes, texts = figure.axes[0], dict[str, str | list[str]]()
    for experiment, size in shown.sizes.items():
        rows = shown.mean.filter(pc.field("experiment") == experiment)
        gid = f"curve-{len(texts)}"
        texts[gid] = f"{label(experiment)}: mean of {counted(size, 'run')}"
        # The line is there already: this one has the text.
        axes.plot(rows["births"], rows["mean"], gid=gid, alpha=0.0)
    for folder, name in names.items():
        rows = shown.by_run.filter(pc.field("folder") == folder)
        if rows.num_rows:
            gid, end = f"curve-{len(texts)}", rows.slice(rows.num_rows - 1)
            fitness, births = end["mean"][0].as_py(), end["births"][0]
            texts[gid] = f"{name}\nmean fitness {fitness:.3g} at {births} births"
            colour = paint[name.experiment]
            axes.plot(
                rows["births"], rows["mean"], gid=gid, color=colour, alpha=0.65, lw=0.7
            )
        own = robots.filter(pc.field("folder") == folder).to_pylist()
        places = [(row["births"], row["fitness_max"]) for row in own]
        _add_dots(axes, texts, places, own, (name, paint[name.experiment]))
    return interactive(figure, texts, "Fitness over births")


def _add_dots(
    axes: Any,  # noqa: ANN401 - matplotlib
    texts: dict[str, str | list[str]],
    places: Sequence[tuple[float, float]],
    robots: Sequence[Row],
    run: tuple[RunName, str],
) -> None:
    if not places:
        return
    gid, (name, colour) = f"dots-{len(texts)}", run
    axes.scatter(
        *zip(*places, strict=True), s=9, gid=gid, color=colour, edgecolors="white",
        linewidths=0.3, zorder=50,
    )  # fmt: skip
    texts[gid] = [
        f"robot {row['birth_island']}:{row['birth']}, {name}\nfitness {fitness:.3g}; "
        f"{counted(row['parts'], 'part')}, {counted(row['active_joints'], 'motor')}, "
        f"{counted(row['hidden'], 'hidden neuron')}"
        for row, (_, fitness) in zip(robots, places, strict=True)
    ]


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


def last_populations(tables: Tables, y_text: str) -> str:
    """Return the plot of all robots of the last populations, a column per run.

    It is empty if no run has a population, or if there are too many robots.
    """
    living = tables["robots"].filter(pc.field("is_last"))
    if not 0 < living.num_rows <= _MOST_DOTS:
        return ""
    names = run_names(tables["runs"])
    paint = colours(name.experiment for name in names.values())
    shown = in_order(living["experiment"].to_pylist())
    figure = columns_of(shown, living["fitness"].to_pylist(), y_text).draw()
    axes, texts = figure.axes[0], dict[str, str | list[str]]()
    of_runs: dict[str, dict[str, list[Row]]] = {}
    for row in living.to_pylist():
        runs = of_runs.setdefault(row["experiment"], {})
        runs.setdefault(row["folder"], []).append(row)
    for place, experiment in enumerate(shown):
        runs = of_runs[experiment]
        width = 0.8 / max(len(runs), _COLUMNS)
        for at, (folder, rows) in enumerate(runs.items()):
            middle = place + width * (at - 0.5 * (len(runs) - 1))
            places = [
                (middle + width * 0.6 * ((count * 0.618) % 1 - 0.5), row["fitness"])
                for count, row in enumerate(rows)
            ]
            named = names[folder], paint[experiment]
            _add_dots(axes, texts, places, rows, named)
            mean = float(np.mean([row["fitness"] for row in rows]))
            ends = middle - 0.4 * width, middle + 0.4 * width
            gid = f"curve-{len(texts)}"
            texts[gid] = f"{names[folder]}\nmean {mean:.3g} of {len(rows)} robots"
            axes.plot(ends, (mean, mean), gid=gid, color=INK, lw=1.5, zorder=60)
    return interactive(figure, texts, "Fitness of the last populations")
