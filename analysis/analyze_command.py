"""``revolve analyze``: from run folders to measures, figures and a report."""

import argparse
import platform
import shlex
from collections.abc import Callable, Sequence
from dataclasses import asdict
from datetime import UTC, datetime
from importlib.metadata import PackageNotFoundError, version

import pyarrow as pa
import pyarrow.parquet as pq
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TimeRemainingColumn

from analysis.comparison.comparison import Outcomes, comparison, findings
from analysis.comparison.progression import progression
from analysis.figures.figure_writer import draw_figures
from analysis.figures.report import Drawn, Making, report
from analysis.measures.benchmarks import read_benchmarks
from analysis.measures.distinct_names import told_apart
from analysis.measures.load import LeftOut, Run, read_runs
from analysis.measures.outputs import OUTPUTS, schema
from analysis.measures.study import gathered, measure_runs
from analysis.progress import bars
from analysis.render.picture import Simulate
from analysis.summary import show
from schema.errors import RunFolderError

MEASURES, FIGURES, REPORT = "measures", "figures", "report.html"
_ALWAYS = ("populations", "robots", "extremities")
"""Measures that all that follows reads, whatever could be measured."""
_LIBRARIES = ("revolve-islands", "mujoco-core", "numpy", "pyarrow", "plotnine")


def analyze(
    options: argparse.Namespace, words: Sequence[str], simulate: Callable[[], Simulate]
) -> int:
    """Measure runs, draw what the measures allow, and write the report.

    Args:
        options: ``runs``, ``out``, ``slots``, ``processes``.
        words: of the command line, for the report.
        simulate: returns the worker's simulation, or raises what keeps pictures from
            being drawn.

    Returns:
        0 if done, whatever was left out.

    Raises:
        RunFolderError: no run, or nowhere to write.
    """
    folders = [path for path in options.runs if path.is_dir() or not path.is_file()]
    if not folders:
        raise RunFolderError(f"{options.runs[0]}: must be a folder, got a file")
    found, unread = read_runs(folders)
    runs = told_apart(found)
    benchmark, not_benchmarks = read_benchmarks(options.runs)
    columns = ("{task.description}", BarColumn(), MofNCompleteColumn())
    try:
        (options.out / FIGURES).mkdir(parents=True, exist_ok=True)
    except OSError as error:
        why = f"cannot be written: {error.strerror}"
        raise RunFolderError(f"{options.out}: {why}") from None
    with bars(f"runs to measure: {len(runs)}", *columns, TimeRemainingColumn()) as bar:
        tables, left_out = _measured(runs, options, bar)
        drawn, undrawn = draw_figures(
            {**tables, "benchmark": benchmark},
            {run.folder: run for run in runs},
            options.out / FIGURES,
            simulate,
            bar,
        )
    tables["left_out"] = pa.Table.from_pylist(
        [asdict(one) for one in (*unread, *not_benchmarks, *left_out, *undrawn)],
        schema("left_out"),
    )
    (options.out / MEASURES).mkdir(parents=True, exist_ok=True)
    for name in OUTPUTS:
        if name not in tables:  # of an analysis before
            (options.out / MEASURES / f"{name}.parquet").unlink(missing_ok=True)
    for name, table in tables.items():
        pq.write_table(table, options.out / MEASURES / f"{name}.parquet")
    page = report(tables, drawn, _making(words))
    (options.out / REPORT).write_text(page, encoding="utf-8")
    show(tables, Console())
    print(f"{options.out / MEASURES}: {len(tables)} tables, {', '.join(tables)}")
    print(f"{options.out / FIGURES}: {_told(drawn)}")
    print(f"{options.out / REPORT}: all of it in one file")
    return 0


def _measured(
    runs: list[Run], options: argparse.Namespace, bar: Progress
) -> tuple[dict[str, pa.Table], list[LeftOut]]:
    """Return all tables of all runs, and those over runs."""
    task = bar.add_task("runs measured", total=len(runs))
    measured = measure_runs(
        runs,
        slots="own" if options.slots == "own" else "parent",
        processes=options.processes,
        tell=lambda: bar.advance(task),
    )
    comparing = bar.add_task("experiments compared", total=None)
    empty = {name: schema(name).empty_table() for name in _ALWAYS}
    tables = {**empty, **gathered(measured)}
    tables["progression"] = progression(tables["populations"])
    outcomes = Outcomes(measured)
    tables["outcomes"] = outcomes.table()
    tables["comparison"] = comparison(outcomes)
    tables["findings"] = findings(outcomes)
    bar.remove_task(comparing)
    return tables, [one for run in measured for one in run.left_out]


def _told(figures: Sequence[Drawn]) -> str:
    """Return which figures there are, in words."""
    if not figures:
        return "no figure could be drawn; the lines 'left out: figure' tell why"
    numbers = ", ".join(one.number for one in figures)
    return f"figures {numbers} as PDF and PNG"


def _making(words: Sequence[str]) -> Making:
    versions = {"python": platform.python_version(), "system": platform.platform()}
    for name in _LIBRARIES:
        try:
            versions[name] = version(name)
        except PackageNotFoundError:
            versions[name] = "not installed as a package"
    now = datetime.now(UTC).strftime("%Y-%m-%d %H:%M UTC")
    return Making(shlex.join(["revolve", *words]), now, versions)
