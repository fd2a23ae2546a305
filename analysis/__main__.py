"""``revolve analyze``: tables to measures, figures and a report."""

import os
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

from schema.errors import RevolveError
from schema.experiment.plugin_access import allow
from schema.flags import Flags, add_plugins, whole_number


class MissingExtra(RevolveError):  # noqa: N818 - names what is missing
    """A library that only analysis needs is not installed."""


def main(arguments: list[str]) -> int:
    """Run ``revolve analyze``, ``robot render`` or ``view``.

    Args:
        arguments: the command's name first.

    Returns:
        Exit code.

    Raises:
        RunFolderError: no run is found.
        MissingExtra: a library is not installed.
    """
    if arguments[0] == "robot render":
        simulate = _simulation()
        from analysis.render.command import main as render

        return render(arguments, simulate)
    if arguments[0] == "view":
        return _view(arguments)
    options = _flags().parse_args(arguments[1:])
    allow(options.plugins)
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
        epilog="for example: revolve analyze runs --out report; files of benchmarks "
        "(revolve bench arena --out FILE) may be given with the runs",
    )
    flags.add_argument(
        "runs", nargs="+", type=Path, help="run folders, or folders that contain them"
    )
    flags.add_argument(
        "--out",
        type=Path,
        default=Path("report"),
        help="folder to write to (default: report)",
    )
    flags.add_argument(
        "--slots",
        choices=("parent", "own"),
        default="parent",
        help="slot that labels a part in the distance of bodies: its parent's, as in "
        "the thesis (default), or its own, as in the published code",
    )
    flags.add_argument(
        "--processes",
        type=whole_number(),
        default=os.cpu_count() or 1,
        metavar="N",
        help="number of runs measured in parallel (default: number of cores)",
    )
    add_plugins(flags)
    return flags


def _simulation() -> Callable[..., Any]:
    """Return the worker's simulation, after choosing the renderer's backend.

    Raises:
        MissingExtra: a library for rendering is not installed.
        NoPictures: this machine cannot render.
    """
    try:
        from analysis.render.picture import choose_engine

        # Before MuJoCo is imported.
        choose_engine()
        from worker.robot.evaluation import simulate
    except ImportError as error:
        raise MissingExtra(
            f"pictures need {error.name}: pip install 'revolve-islands[view]'"
        ) from None
    return simulate


def _view(arguments: list[str]) -> int:
    """Show a run; robots are re-simulated by the worker from the run's journal."""
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
