"""``revolve analyze``: tables to figures."""

import sys
from pathlib import Path

from analysis.load import load_table, run_folders
from analysis.measures import progression
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
        description="Draw fitness over births of runs, grouped by experiment.",
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
    table = progression(load_table(run_folders(options.runs), "population"))
    options.out.mkdir(parents=True, exist_ok=True)
    save(progression_figure(table), options.out / "progression")
    print(f"{options.out / 'progression.png'}: fitness over births (also .pdf)")
    return 0


if __name__ == "__main__":
    sys.exit(main(["analyze", *sys.argv[1:]]))
