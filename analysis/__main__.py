"""``revolve analyze``: tables to figures."""

import sys
from pathlib import Path

import pyarrow as pa
from rich.console import Console
from rich.table import Table

from analysis.load import load_table, run_folders
from analysis.measures import final_fitness, progression
from schema.agent_command import Flags
from schema.errors import RevolveError


class MissingExtra(RevolveError):  # noqa: N818 - reads as what it says
    """A library that only figures need is not installed."""


def main(arguments: list[str]) -> int:
    """Draw what the tables of some runs allow.

    Args:
        arguments: the command's name first.

    Returns:
        0 if done.

    Raises:
        RunFolderError: no run, or nothing born in it.
        MissingExtra: the plotting library is not there.
    """
    flags = Flags(
        prog="revolve analyze",
        description="Tell how fit runs became, and draw fitness over births.",
        epilog="for example: revolve analyze runs --out figures",
    )
    flags.add_argument("runs", nargs="+", type=Path, help="run folders, or above some")
    flags.add_argument("--out", type=Path, default=Path("figures"), help="folder")
    options = flags.parse_args(arguments[1:])
    try:
        from analysis.figures import progression_figure, save
    except ImportError as error:
        raise MissingExtra(
            f"figures need {error.name}: pip install 'revolve-islands[analysis]'"
        ) from None
    population = load_table(run_folders(options.runs), "population")
    _show(final_fitness(population))
    options.out.mkdir(parents=True, exist_ok=True)
    save(progression_figure(progression(population)), options.out / "progression")
    print(f"{options.out / 'progression.png'}: fitness over births (also .pdf)")
    return 0


def _show(final: pa.Table) -> None:
    """Print the last population of each run."""
    table = Table("experiment", "run", "births", "size", "mean fitness", "best")
    for row in final.to_pylist():
        table.add_row(
            row["experiment"],
            Path(row["folder"]).name,
            str(row["births"]),
            str(row["size"]),
            f"{row['mean']:.4f}",
            f"{row['best']:.4f}",
        )
    Console().print(table)


if __name__ == "__main__":
    sys.exit(main(["analyze", *sys.argv[1:]]))
