"""``revolve analyze``: tables to measures and figures."""

import os
import sys
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path

import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.parquet as pq
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TimeRemainingColumn
from rich.table import Table

from analysis.load import LeftOut, Run, read_runs
from analysis.outputs import schema
from schema.agent_command import Flags, at_least_one
from schema.errors import RevolveError

MEASURES = "measures"
_SHOWN = ("fitness", "fitness_best")


class MissingExtra(RevolveError):  # noqa: N818 - reads as what it says
    """A library that only analysis needs is not installed."""


def main(arguments: list[str]) -> int:
    """Measure and draw what the tables of some runs allow.

    Args:
        arguments: the command's name first.

    Returns:
        0 if done, whatever was left out.

    Raises:
        RunFolderError: no run.
        MissingExtra: a library for measures or figures is not there.
    """
    if arguments[:2] == ["robot", "render"]:
        return _render(arguments)
    if arguments[0] == "view":
        return _view(arguments)
    options = _flags().parse_args(arguments[1:])
    runs, left_out = read_runs(options.runs)
    try:
        tables = _measured(runs, options.slots, options.processes)
        from analysis.figures import progression_figure, save
    except ImportError as error:
        raise MissingExtra(
            f"analysis needs {error.name}: pip install 'revolve-islands[analysis]'"
        ) from None
    tables["left_out"] = pa.concat_tables([_left_out(left_out), tables["left_out"]])
    folder = options.out / MEASURES
    folder.mkdir(parents=True, exist_ok=True)
    for name, table in tables.items():
        pq.write_table(table, folder / f"{name}.parquet")
    _show(tables)
    fitness = tables["progression"].filter(pc.field("measure") == "fitness")
    if fitness.num_rows:
        save(progression_figure(fitness), options.out / "progression")
        print(f"{options.out / 'progression.png'}: fitness over births (also .pdf)")
    print(f"{folder}: {len(tables)} tables, {', '.join(tables)}")
    return 0


def _flags() -> Flags:
    flags = Flags(
        prog="revolve analyze",
        description="Measure runs, compare experiments, draw fitness over births.",
        epilog="for example: revolve analyze runs --out report",
    )
    flags.add_argument("runs", nargs="+", type=Path, help="run folders, or above some")
    flags.add_argument(
        "--out", type=Path, default=Path("report"), help="folder (default: report)"
    )
    flags.add_argument(
        "--slots",
        choices=("parent", "own"),
        default="parent",
        help="whose slot counts in the distance of bodies: its parent's as in the "
        "thesis, or its own as in the published code",
    )
    flags.add_argument(
        "--processes",
        type=at_least_one,
        default=os.cpu_count() or 1,
        metavar="N",
        help="runs measured at a time (default: the cores)",
    )
    return flags


def _measured(runs: list[Run], slots: str, processes: int) -> dict[str, pa.Table]:
    """Return all tables of all runs, and those over runs."""
    from analysis.comparison import Outcomes, comparison, findings
    from analysis.progression import progression
    from analysis.study import gathered, measure_runs

    columns = ("{task.description}", BarColumn(), MofNCompleteColumn())
    with Progress(
        *columns, TimeRemainingColumn(), console=Console(stderr=True), transient=True
    ) as bar:
        task = bar.add_task("runs measured", total=len(runs))
        measured = measure_runs(
            runs,
            slots="own" if slots == "own" else "parent",
            processes=processes,
            tell=lambda: bar.advance(task),
        )
        bar.add_task("experiments compared", total=None)
        tables = gathered(measured)
        tables["progression"] = progression(tables["populations"])
        outcomes = Outcomes(measured)
        tables["outcomes"] = outcomes.table()
        tables["comparison"] = comparison(outcomes)
        tables["findings"] = findings(outcomes)
    tables["left_out"] = _left_out([one for run in measured for one in run.left_out])
    return tables


def _left_out(entries: Sequence[LeftOut]) -> pa.Table:
    return pa.Table.from_pylist([asdict(one) for one in entries], schema("left_out"))


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
    for row in tables["left_out"].to_pylist():
        console.print(
            f"left out: {row['folder']}: {row['what']}: {row['why']}", soft_wrap=True,
            markup=False, highlight=False,
        )  # fmt: skip


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


def _render(arguments: list[str]) -> int:
    """Draw a robot, by the worker's simulation if it is to move."""
    try:
        from analysis.render import choose_engine
        from analysis.render_command import main as render
    except ImportError as error:
        raise MissingExtra(
            f"pictures need {error.name}: pip install 'revolve-islands[view]'"
        ) from None
    # Before anything loads the engine.
    choose_engine()
    from worker.evaluation import simulate

    return render(arguments, simulate)


def _view(arguments: list[str]) -> int:
    """Show a run, by the worker's and the coordinator's word if robots are to move."""
    try:
        from analysis.view import main as view
    except ImportError as error:
        raise MissingExtra(
            f"the viewer needs {error.name}: pip install 'revolve-islands[view]'"
        ) from None
    from analysis.view_again import Simulators
    from coordinator.history import arena_history
    from worker.again import alone, together

    return view(arguments, Simulators(alone, arena_history, together))


if __name__ == "__main__":
    sys.exit(main(["analyze", *sys.argv[1:]]))
