"""``revolve analyze``: from run folders to measures, figures and a report."""

import argparse
import platform
import shlex
from collections.abc import Callable, Sequence
from dataclasses import asdict
from datetime import UTC, datetime
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.parquet as pq
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TimeRemainingColumn
from rich.table import Table

from analysis.benchmarks import read_benchmarks
from analysis.comparison import Outcomes, comparison, findings
from analysis.load import LeftOut, Run, read_runs
from analysis.namesakes import told_apart
from analysis.outputs import OUTPUTS, schema
from analysis.plates import draw_figures
from analysis.progression import progression
from analysis.render_command import Simulate
from analysis.report import Making, report
from analysis.study import gathered, measure_runs
from schema.errors import RunFolderError

MEASURES, FIGURES, REPORT = "measures", "figures", "report.html"
_ALWAYS = ("populations", "robots", "extremities")
"""Measures that all that follows reads, whatever could be measured."""
_SHOWN = ("fitness", "fitness_best")
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
    with Progress(
        *columns, TimeRemainingColumn(), console=Console(stderr=True), transient=True
    ) as bar:
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
    _show(tables)
    print(f"{options.out / MEASURES}: {len(tables)} tables, {', '.join(tables)}")
    numbers = ", ".join(one.number for one in drawn)
    print(f"{options.out / FIGURES}: figures {numbers} as PDF and PNG")
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


def _making(words: Sequence[str]) -> Making:
    versions = {"python": platform.python_version(), "system": platform.platform()}
    for name in _LIBRARIES:
        try:
            versions[name] = version(name)
        except PackageNotFoundError:
            versions[name] = "not installed as a package"
    now = datetime.now(UTC).strftime("%Y-%m-%d %H:%M UTC")
    return Making(shlex.join(["revolve", *words]), now, versions)


def _show(tables: dict[str, pa.Table]) -> None:
    """Print each run's last populations, the findings, and what was left out."""
    console = Console()
    console.print(_last_populations(tables["populations"]))
    compared = tables["findings"].filter(pc.field("runs_a").is_valid())
    if compared.num_rows:
        table = Table("figure", "finding of the thesis", "a", "b", "q", "verdict")
        for row in compared.to_pylist():
            numbers = [f"{row[name]:.3g}" for name in ("mean_a", "mean_b", "q")]
            table.add_row(row["figure"], row["claim"], *numbers, row["verdict"])
        console.print(table)
    for name, differs in _renamed(tables["runs"]).items():
        console.print(f"{name}: {differs}", soft_wrap=True, markup=False,
                      highlight=False)  # fmt: skip
    for row in tables["left_out"].to_pylist():
        whose = f"{row['folder']}: " if row["folder"] else ""
        console.print(
            f"left out: {whose}{row['what']}: {row['why']}", soft_wrap=True,
            markup=False, highlight=False,
        )  # fmt: skip


def _renamed(runs: pa.Table) -> dict[str, str]:
    """Return experiments that another one shares a name with, and how they differ."""
    rows = runs.filter(pc.not_equal(runs["differs"], "")).to_pylist()
    return {row["experiment"]: row["differs"] for row in rows}


def _last_populations(populations: pa.Table) -> Table:
    table = Table("experiment", "run", "births", "size", "mean fitness", "best")
    keys = ["experiment", "folder", "island"]
    last = populations.group_by(keys, use_threads=False).aggregate([("births", "max")])
    joined = populations.join(last, keys)
    rows = joined.filter(pc.equal(joined["births"], joined["births_max"]))
    for row in rows.sort_by([(key, "ascending") for key in keys]).to_pylist():
        fitness = ("-" if row[name] is None else f"{row[name]:.4f}" for name in _SHOWN)
        table.add_row(
            row["experiment"],
            Path(row["folder"]).name + (f" {row['island']}" if row["island"] else ""),
            str(row["births"]),
            str(row["judged"]),
            *fitness,
        )
    return table
