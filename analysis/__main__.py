"""``revolve analyze``: tables to measures, figures and a report."""

import argparse
import os
from collections.abc import Callable
from typing import Any

from analysis.render.flags import FILM_ENDINGS, PAGE_ENDING
from schema.agent.extras import extra
from schema.agent.flags import Flags
from schema.plugins.permission import allow
from schema.tables.description import check_folder


def main(arguments: list[str]) -> int:
    """Run one of the commands of ``parser``; return the exit code.

    Raises:
        RunFolderError: no run is found.
        RevolveError: a library is not installed.
    """
    options = parser(arguments[0]).parse_args(arguments[1:])
    if arguments[0] == "robot render":
        simulate = _simulation()
        with extra("pictures need", "pictures"):
            from analysis.render.command import render
        return render(options, simulate)
    if arguments[0] == "robot page":
        simulate = _simulation()
        with extra("pages need", "pictures"):
            from analysis.page.robots import robot_page
        from worker.robot.evaluation import evaluate

        return robot_page(options, simulate, evaluate)
    if arguments[0] == "view":
        return _view(options)
    allow(options.plugins)
    # Before matplotlib is imported: it refuses backends of other programs.
    os.environ["MPLBACKEND"] = "agg"
    with extra("analysis needs", "analysis"):
        from analysis.render.stage import choose_engine

        # Before MuJoCo is imported.
        choose_engine()
        from analysis.analyze_command import analyze
    from worker.robot.evaluation import evaluate

    return analyze(options, arguments, _simulation, evaluate)


def parser(command: str) -> Flags:
    """Return the parser of ``analyze``, ``view``, ``robot page`` or ``robot render``.

    It needs none of the libraries that the command itself needs.
    """
    if command == "view":
        from analysis.viewer.flags import parser as flags_of
    elif command == "robot page":
        from analysis.render.flags import page_parser as flags_of
    elif command == "robot render":
        from analysis.render.flags import parser as flags_of
    else:
        from analysis.figures.flags import parser as flags_of
    return flags_of()


def _simulation() -> Callable[..., Any]:
    """Return the worker's simulation, after choosing the renderer's backend."""
    with extra("pictures need", "pictures"):
        from analysis.render.stage import choose_engine

        # Before MuJoCo is imported.
        choose_engine()
        from worker.robot.evaluation import simulate
    return simulate


def _view(options: argparse.Namespace) -> int:
    """Show a run; robots are re-simulated by the worker from the run's journal.

    A film of an arena needs no viewer.
    """
    if options.run is not None and options.connect is None:
        check_folder(options.run)  # before a library that may be missing
    ending = options.save.suffix.lower() if options.save is not None else ""
    if ending == PAGE_ENDING:
        with extra("pages need", "pictures"):
            from analysis.page.arena import arena_page
        return arena_page(options)
    if ending in FILM_ENDINGS:
        with extra("pictures need", "pictures"):
            from analysis.render.stage import choose_engine

            # Before MuJoCo is imported.
            choose_engine()
            from analysis.viewer.arena_film import film
        return film(options)
    with extra("the viewer needs", "view"):
        from analysis.viewer.command import view
    from analysis.viewer.resimulate import Simulators
    from coordinator.run.history import arena_history
    from worker.arena.replay import alone, together

    return view(options, Simulators(alone, arena_history, together))
