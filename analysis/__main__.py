"""``revolve analyze``: tables to measures, figures and a report."""

import os
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from schema.agent.flags import Flags, add_plugins, whole_number
from schema.errors import RevolveError
from schema.plugins.permission import allow


class MissingExtra(RevolveError):  # noqa: N818 - names what is missing
    """A library that only analysis needs is not installed."""


@contextmanager
def _extra(what: str, extra: str) -> Iterator[None]:
    """Name the extra of the package with a library that cannot be imported.

    Raises:
        MissingExtra: a library is not installed.
    """
    try:
        yield
    except ImportError as error:
        install = f"pip install 'revolve-islands[{extra}]'"
        raise MissingExtra(f"{what} {error.name}: {install}") from None


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
    with _extra("analysis needs", "analysis"):
        from analysis.analyze_command import analyze
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
    """
    with _extra("pictures need", "pictures"):
        from analysis.render.picture import choose_engine

        # Before MuJoCo is imported.
        choose_engine()
        from worker.robot.evaluation import simulate
    return simulate


def _view(arguments: list[str]) -> int:
    """Show a run; robots are re-simulated by the worker from the run's journal."""
    with _extra("the viewer needs", "view"):
        from analysis.viewer.command import main as view
    from analysis.viewer.resimulate import Simulators
    from coordinator.run.history import arena_history
    from worker.arena.replay import alone, together

    return view(arguments, Simulators(alone, arena_history, together))


if __name__ == "__main__":
    sys.exit(main(["analyze", *sys.argv[1:]]))
