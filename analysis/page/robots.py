"""``revolve robot page``: robots that move in a browser."""

import argparse
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from analysis.measures.families import family
from analysis.page.content import grounds, moving, packed, page
from analysis.progress import bars
from analysis.render.command import lasting_for, read_shown
from analysis.render.files import NoPictures, writing
from analysis.render.flags import PAGE_ENDING
from analysis.render.motion import lanes, recorded
from analysis.render.picture import Simulate
from analysis.viewer.ground import surfaces
from schema.agent.log import tell_user
from schema.experiment.document import body_space
from schema.experiment.settings import EvaluationSettings
from schema.formats.files import BEST
from schema.plugins.permission import allow
from schema.robot.ids import BirthId
from schema.robot.results import Evaluation
from schema.robot.robot import Robot
from schema.robot.trace import Floats
from schema.tables.files import read_table
from schema.tables.last_populations import best_ever, best_of, last_populations
from schema.wire.updates import individual

INTERVAL_S = 0.04
"""Time between two states of a robot's motion [s]; the browser draws between them."""

Evaluate = Callable[[Robot, EvaluationSettings], Evaluation]


def robot_page(
    options: argparse.Namespace, simulate: Simulate, evaluate: Evaluate
) -> int:
    """Write a page of robots; return the exit code.

    Raises:
        NoPictures: the file has another ending or cannot be written, or the flags
            conflict.
        RevolveError: as of ``read_shown``, ``simulate`` and ``evaluate``.
    """
    allow(options.plugins)
    out: Path = options.out
    if out.suffix.lower() != PAGE_ENDING:
        raise NoPictures(f"{out}: must end in {PAGE_ENDING}, got {out.suffix!r}")
    shown = read_shown(options)
    motions: list[list[Floats]] = []
    commands: list[list[Floats]] = [[] for _ in shown]
    with bars(f"simulating robots: {len(shown)}") as bar:
        tracked = bar.track(shown.values(), description="simulating")
        for (robot, own), ticks in zip(tracked, commands, strict=True):
            lasting = lasting_for(own, options.seconds)
            motions.append(recorded(simulate, robot, lasting, INTERVAL_S, ticks))
        robots = []
        paths = lanes(motions, shown)
        for file, name, path, ticks in zip(
            options.files, shown, paths, commands, strict=True
        ):
            robot, own = shown[name]
            facts = _facts_of_run(file) or {"fitness": evaluate(robot, own).fitness}
            robots.append(
                moving(
                    name, robot, body_space(own.space), path, interval_s=INTERVAL_S,
                    commands=packed(ticks), commands_s=own.simulation.tick_s,
                    motors=len(ticks[0]), **facts,
                )
            )  # fmt: skip
    around: list[dict[str, Any]] = []
    if len(shown) == 1:
        ((_, own),) = shown.values()
        world = own.environment
        below = surfaces(world, own.simulation, world.light)
        around = grounds(below, np.zeros((0, 10)))
    content = {"robots": robots, "grounds": around, "curves": []}
    lead = "Drag to turn, scroll to zoom; click the name of a robot to follow it."
    with writing(out):
        out.write_text(page(", ".join(shown), lead, content), "utf-8")
    tell_user(f"saved {out}, {out.stat().st_size / 1e6:.1f} MB; a browser shows it")
    return 0


def _facts_of_run(folder: Path) -> dict[str, Any]:
    """Return fitness and ancestry of a run's best robot; empty of another file."""
    if not (folder / BEST).is_file():
        return {}
    best = best_of(last_populations(folder))
    if best is None:
        return {}
    births = read_table(folder, "births")
    known = {individual(row): row["fitness"] for row in best_ever(folder)}
    columns = (births[name].to_pylist() for name in ("island", "birth"))
    ids = [BirthId(*pair) for pair in zip(*columns, strict=True)]

    def shown(row: int) -> dict[str, Any]:
        return {"row": row, "name": ids[row].name, "fitness": known.get(ids[row])}

    relatives = family(births, ids.index(individual(best)))
    levels = [list(map(shown, level)) for level in relatives.levels]
    ancestry = {"levels": levels, "edges": relatives.edges}
    return {"fitness": best["fitness"], "ancestry": ancestry}
