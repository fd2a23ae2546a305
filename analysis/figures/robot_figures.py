"""Figures of the best robots: their gaits and families."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path

import pyarrow as pa
import pyarrow.compute as pc
from rich.progress import Progress

from analysis.figures.catalogue import BIRTHS, Figure, missing
from analysis.figures.family_tree import best_robots, lineage, row_of
from analysis.figures.pictures import family_tree, gaits
from analysis.figures.robot_pictures import (
    RobotPicture,
    robot_picture,
    shown_experiment,
)
from analysis.figures.style import in_order, label
from analysis.measures.families import family
from analysis.measures.load import LoadedRun
from analysis.render.picture import Simulate
from schema.errors import RevolveError
from schema.experiment.identity import Origin
from schema.robot.ids import BirthId
from schema.tables.files import read_table
from schema.tables.learnt import with_learnt

TREES = {"scenario1": "6.18", "scenario2": "6.19", "scenario3": "6.20"}
"""Numbers of the figures of families of the thesis's experiments."""
_BASELINES = ("no-reproduction", "no-selection")
"""Experiments without an ancestry that selection made."""
PART_COLOURS = (
    "A part's colour shows the founder that the part descends from; white parts were "
    "added by mutation. Parts of encodings that give them no identity keep their own "
    "colour."
)
GAITS = "6.10"
"""Number of the figure of gaits."""
_SOURCE = ("robots", BIRTHS)


def _tree_number(experiment: str) -> str:
    return TREES.get(experiment, f"G-{experiment}")


def robot_pictures(
    robots: pa.Table,
    runs: Mapping[Path, LoadedRun],
    simulate: Callable[[], Simulate],
    bar: Progress,
    lines: dict[str, pa.Table],
) -> tuple[dict[str, RobotPicture], dict[str, str]]:
    """Return pictures of the best robots by experiment, and why others have none.

    The lineages of those whose family is shown are added to ``lines``.
    """
    best = {one.experiment: one for one in best_robots(robots)}
    living = robots.filter(pc.field("is_last"))["experiment"].to_pylist()
    why = "all robots of its last populations failed"
    problems = {name: why for name in in_order(living) if name not in best}
    try:
        simulation = simulate()
    except RevolveError as error:
        return {}, problems | dict.fromkeys(best, str(error))
    pictures: dict[str, RobotPicture] = {}
    for name in bar.track(in_order(best), description="rendering robots"):
        run = runs[best[name].folder]
        try:
            experiment = shown_experiment(run)
            tables = (read_table(run.folder, each) for each in ("births", "learning"))
            births = with_learnt(*tables)
            row = row_of(best[name], births)
            pictures[name] = robot_picture(
                best[name],
                births,
                family(births, row),
                experiment,
                simulation,
                origin=Origin(seed=run.seed, run=run.number),
                has_family=name not in _BASELINES,
            )
            if name not in _BASELINES:
                lines[name] = lineage(births, name, row)
        except RevolveError as error:
            problems[name] = str(error)
    return pictures, problems


def gait_figures(
    pictures: Sequence[RobotPicture],
    problems: Mapping[str, str],
    units: Mapping[str, str],
) -> Iterator[Figure]:
    """Yield the figure of gaits, and what is missing in it."""
    for name, why in problems.items():
        yield missing(f"{GAITS} of {name}", why)
    if not pictures and not problems:
        yield missing(GAITS, "no evaluated robot is in a recorded population")
    if pictures:
        yield Figure(
            GAITS,
            "Gaits of the best robots",
            "The fittest robot of each experiment's last populations, simulated alone "
            "and shown from the middle of its evaluation on, by a camera that stands "
            "still; a tile of the floor has 10 cm. Pictures of robots that move less "
            "than 10 cm in that time are taken further apart, up to the end of the "
            f"evaluation. {PART_COLOURS}",
            _SOURCE,
            lambda _: gaits(pictures, units),
            "robots",
        )


def tree_figures(
    pictures: Mapping[str, RobotPicture],
    problems: Mapping[str, str],
    lines: Mapping[str, pa.Table],
    robots: pa.Table,
    units: Mapping[str, str],
) -> Iterator[Figure]:
    """Yield the family of each best robot but those of baselines."""
    for name in dict.fromkeys((*TREES, *pictures)):
        if name in lines:
            ancestors = lines[name].num_rows - 1
            yield _tree(pictures[name], ancestors, robots, units.get(name, ""))
        elif name not in pictures:
            why = f"no evaluated robot of {name} is in a recorded population"
            yield missing(_tree_number(name), problems.get(name, why))


def _tree(robot: RobotPicture, ancestors: int, robots: pa.Table, unit: str) -> Figure:
    best, relatives = robot.best, robot.family
    assert relatives is not None
    number = _tree_number(best.experiment)
    if len(relatives.levels) == 1:
        return missing(number, f"the best robot of {best.experiment} is a founder")
    mine = robots.filter(pc.field("folder") == str(best.folder))
    known = mine.select(["birth_island", "birth", "fitness"]).to_pylist()
    fitness = {
        BirthId(row["birth_island"], row["birth"]): row["fitness"] for row in known
    }
    colours = (
        "Above the dashed line are the founders whose parts survive in these robots; a "
        "part has the colour of its founder, and white parts were added by mutation."
    )
    if not relatives.founders:
        colours = (
            "The encoding gives parts no identity that children inherit, so the "
            "founders of parts are not known."
        )
    caption = (
        f"Robot {best.birth_island}:{best.birth} of {best.folder.name}, the fittest "
        "robot of the last populations, at the bottom, and its ancestors over four "
        "levels of reproduction: parents are drawn above their children. A dotted line "
        f"leads to a parent that is drawn on another level. {colours} The robot has "
        f"{ancestors} ancestors in total."
    )
    return Figure(
        number,
        f"Ancestry of the best robot of {label(best.experiment)}",
        caption,
        _SOURCE,
        lambda _: family_tree(robot, relatives, fitness, unit),
        "robots",
        f"ancestry-of-{best.experiment}",
    )
