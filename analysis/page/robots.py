"""``revolve robot page``: robots that move in a browser."""

import argparse
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from analysis.measures.families import family
from analysis.page.content import grounds, moving, packed, page
from analysis.progress import bars
from analysis.render.command import lasting_for, read_shown
from analysis.render.files import NoPictures, writing
from analysis.render.flags import PAGE_ENDING
from analysis.render.motion import Shown, lanes, recorded
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
        facts = [
            _facts_of_run(file) or {"fitness": evaluate(*one).fitness}
            for file, one in zip(options.files, shown.values(), strict=True)
        ]
    text = page_of(shown, motions, commands, facts, INTERVAL_S)
    with writing(out):
        out.write_text(text, "utf-8")
    tell_user(f"saved {out}, {out.stat().st_size / 1e6:.1f} MB; a browser shows it")
    return 0


def page_of(
    shown: Shown,
    motions: Sequence[Sequence[Floats]],
    commands: Sequence[Sequence[Floats]],
    facts: Sequence[Mapping[str, Any]],
    interval_s: float,
) -> str:
    """Return the page of robots, with the states and commands of ``recorded``.

    ``facts`` are those of ``moving``.
    """
    robots = [
        moving(
            name, robot, body_space(own.space), path, interval_s=interval_s,
            commands=packed(ticks), commands_s=own.simulation.tick_s,
            motors=len(ticks[0]), **fact,
        )
        for (name, (robot, own)), path, ticks, fact in zip(
            shown.items(), lanes(motions, shown), commands, facts, strict=True
        )
    ]  # fmt: skip
    (_, own), *others = shown.values()
    world = own.environment
    around = () if others else surfaces(world, own.simulation, world.light)
    below = grounds(around, np.zeros((0, 10)))
    content = {"robots": robots, "grounds": below, "curves": []}
    lead = "Drag to turn, scroll to zoom; click the name of a robot to follow it."
    return page(", ".join(shown), lead, content)


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
