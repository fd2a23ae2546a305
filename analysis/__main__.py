"""``revolve analyze``: tables to measures, figures and a report."""

import os
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

from schema.errors import RevolveError
from schema.flags import Flags, whole_number


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
    if arguments[0] == "robot render":
        return _render(arguments)
    if arguments[0] == "view":
        return _view(arguments)
    options = _flags().parse_args(arguments[1:])
    try:
        from analysis.analyze_command import analyze
    except ImportError as error:
        raise MissingExtra(
            f"analysis needs {error.name}: pip install 'revolve-islands[analysis]'"
        ) from None
    return analyze(options, arguments, _simulation)


def _flags() -> Flags:
    flags = Flags(
        prog="revolve analyze",
        description="Measure runs, compare experiments, draw the thesis's figures, and "
        "write a report.",
        epilog="for example: revolve analyze runs --out report; a benchmark's file "
        "(revolve bench arena --out FILE) may be among the runs",
    )
    flags.add_argument("runs", nargs="+", type=Path, help="folders of runs, or above")
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
        type=whole_number(),
        default=os.cpu_count() or 1,
        metavar="N",
        help="runs measured at a time (default: the cores)",
    )
    return flags


def _render(arguments: list[str]) -> int:
    """Draw a robot, by the worker's simulation if it is to move."""
    simulate = _simulation()
    from analysis.render.command import main as render

    return render(arguments, simulate)


def _simulation() -> Callable[..., Any]:
    """Return the worker's simulation, once what draws is settled.

    Raises:
        MissingExtra: a library for pictures is not there.
        NoPictures: nothing here can draw.
    """
    try:
        from analysis.render.picture import choose_engine

        # Before anything loads the engine.
        choose_engine()
        from worker.robot.evaluation import simulate
    except ImportError as error:
        raise MissingExtra(
            f"pictures need {error.name}: pip install 'revolve-islands[view]'"
        ) from None
    return simulate


def _view(arguments: list[str]) -> int:
    """Show a run, by the worker's and the coordinator's word if robots are to move."""
    try:
        from analysis.viewer.command import main as view
    except ImportError as error:
        raise MissingExtra(
            f"the viewer needs {error.name}: pip install 'revolve-islands[view]'"
        ) from None
    from analysis.viewer.resimulate import Simulators
    from coordinator.run.history import arena_history
    from worker.arena.replay import alone, together

    return view(arguments, Simulators(alone, arena_history, together))


if __name__ == "__main__":
    sys.exit(main(["analyze", *sys.argv[1:]]))
