"""``revolve analyze``: run folders to measures, figures and a report."""

import argparse
import platform
import shlex
from collections.abc import Callable, Sequence
from dataclasses import asdict
from datetime import UTC, datetime
from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TimeRemainingColumn

from analysis.comparison.comparison import comparison, outcomes_of
from analysis.comparison.findings import findings, with_benchmark
from analysis.comparison.progression import progression
from analysis.figures.catalogue import DrawnFigure
from analysis.figures.figure_writer import NUMBERS, draw_figures
from analysis.figures.flags import WIDTHS_IN
from analysis.figures.look import Look, chosen_colours, dressed_in
from analysis.figures.style import in_order
from analysis.measures.benchmarks import read_benchmarks
from analysis.measures.bodies import SlotRule
from analysis.measures.distinct_names import with_distinct_names
from analysis.measures.load import LeftOut, LoadedRun, read_runs
from analysis.measures.outputs import OUTPUTS, schema
from analysis.measures.study import concatenated, measure_runs
from analysis.measures.winners import Evaluate
from analysis.progress import bars, replaced
from analysis.render.picture import Simulate
from analysis.report.page import report
from analysis.summary import show
from schema.agent.supervisor import cores
from schema.agent.version import installed
from schema.errors import RevolveError, counted, shown
from schema.tables.description import check_folder, make_folder

MEASURES, FIGURES, REPORT = "measures", "figures", "report.html"
_ALWAYS = ("populations", "robots", "extremities")
"""Measures that are read in any case; empty if they could not be measured."""
_LIBRARIES = (
    "revolve-islands", "mujoco-core", "numpy", "pyarrow", "scipy", "plotnine",
)  # fmt: skip


def analyze(
    options: argparse.Namespace,
    words: Sequence[str],
    simulate: Callable[[], Simulate],
    evaluate: Evaluate,
) -> int:
    """Measure runs, draw figures, and write the report; return the exit code.

    The words of the command line are for the report. ``simulate`` returns the worker's
    simulation, or raises the reason why robots cannot be rendered; ``evaluate`` is its
    evaluation. Measures and figures that are left out are no failure.

    Raises:
        RunFolderError: no run is found, or the output folder cannot be written.
        RevolveError: a figure or a colour does not exist.
    """
    for name in options.figures:
        if name not in NUMBERS:
            rule = f"--figures: must be of {', '.join(NUMBERS)}"
            raise RevolveError(f"{rule}, got {shown(name)}")
    folders = [path for path in options.runs if not path.is_file()]
    if not folders:
        check_folder(options.runs[0])
    found, unread = read_runs(folders)
    runs = with_distinct_names(found)
    names = in_order(run.experiment for run in runs)
    chosen = chosen_colours(options.colours, names)
    with dressed_in(Look(WIDTHS_IN[options.width], options.style, chosen)):
        return _write(options, words, (simulate, evaluate), runs, unread)


def _write(
    options: argparse.Namespace,
    words: Sequence[str],
    worker: tuple[Callable[[], Simulate], Evaluate],
    runs: list[LoadedRun],
    unread: Sequence[LeftOut],
) -> int:
    """Measure and draw; write all files; return the exit code."""
    simulate, evaluate = worker
    benchmark, not_benchmarks = read_benchmarks(options.runs)
    columns = ("{task.description}", BarColumn(), MofNCompleteColumn())
    for folder in (options.out, options.out / FIGURES):
        make_folder(folder)
    file = options.out / REPORT
    for line in replaced(file, "the report", "its figures and measures"):
        print(line)
    with bars(
        f"measuring {counted(len(runs), 'run')}", *columns, TimeRemainingColumn()
    ) as bar:
        tables, left_out = _measured(runs, benchmark, options, evaluate, bar)
        left_out = [*unread, *not_benchmarks, *left_out]
        # Before the figures: one that fails must not cost the measures.
        _write_measures(tables, left_out, options.out / MEASURES)
        drawings = draw_figures(
            {**tables, "benchmark": benchmark},
            {run.folder: run for run in runs},
            options.out / FIGURES,
            simulate,
            bar,
            wanted=options.figures,
            formats=options.format,
        )
        left_out += drawings.left_out
        _write_measures(tables, left_out, options.out / MEASURES, only="left_out")
    command = shlex.join(["revolve", *words])
    page = report(tables, drawings, command, datetime.now(UTC), _versions())
    (options.out / REPORT).write_text(page, encoding="utf-8")
    show(tables, Console())
    print(f"{options.out / MEASURES}: {len(tables)} tables, {', '.join(tables)}")
    print(f"{options.out / FIGURES}: {_listed(drawings.figures, options.format)}")
    print(f"{options.out / REPORT}: report with all figures in one file")
    return 0


def _measured(
    runs: list[LoadedRun],
    benchmark: pa.Table,
    options: argparse.Namespace,
    evaluate: Evaluate,
    bar: Progress,
) -> tuple[dict[str, pa.Table], list[LeftOut]]:
    slots: SlotRule = "own" if options.slots == "own" else "parent"
    processes = options.processes or cores()
    measuring = measure_runs(runs, slots=slots, processes=processes, evaluate=evaluate)
    measured = list(bar.track(measuring, len(runs), description="measuring runs"))
    comparing = bar.add_task("comparing experiments", total=None)
    empty = {name: schema(name).empty_table() for name in _ALWAYS}
    tables = {**empty, **concatenated(measured)}
    tables["progression"] = progression(tables["populations"])
    outcomes = outcomes_of(measured)
    tables["outcomes"] = outcomes.table()
    tables["comparison"] = comparison(outcomes)
    tables["findings"] = findings(with_benchmark(outcomes, benchmark))
    bar.remove_task(comparing)
    return tables, [one for run in measured for one in run.left_out]


def _write_measures(
    tables: dict[str, pa.Table],
    left_out: Sequence[LeftOut],
    folder: Path,
    only: str = "",
) -> None:
    """Write all measures, or one; remove those that an earlier analysis wrote.

    The table ``left_out`` is added to them.
    """
    rows = [asdict(one) for one in left_out]
    tables["left_out"] = pa.Table.from_pylist(rows, schema("left_out"))
    folder.mkdir(parents=True, exist_ok=True)
    for name in [only] if only else OUTPUTS:
        if name in tables:
            pq.write_table(tables[name], folder / f"{name}.parquet")
        else:
            (folder / f"{name}.parquet").unlink(missing_ok=True)


def _listed(figures: Sequence[DrawnFigure], formats: Sequence[str]) -> str:
    if not figures:
        return "no figure could be drawn; see the line 'left out: figures'"
    numbers = ", ".join(one.figure.number for one in figures)
    return f"figures {numbers} as {' and '.join(map(str.upper, formats))}"


def _versions() -> dict[str, str]:
    versions = {"python": platform.python_version(), "system": platform.platform()}
    missing = "not installed as a package"
    return versions | {name: installed(name) or missing for name in _LIBRARIES}
