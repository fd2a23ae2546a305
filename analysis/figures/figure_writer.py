"""Draws all figures that the data allows, and says of the others why not."""

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.compute as pc
from rich.progress import Progress

from analysis.figures.catalogue import FIGURES, THE_BIRTHS
from analysis.figures.family_tree import LINEAGE, Best, best_robots, ordered
from analysis.figures.forms import NothingToDraw
from analysis.figures.graphviz import NoDot, ordered_by_dot
from analysis.figures.pictures import FOUNDERS, family_tree, gaits
from analysis.figures.report import Drawn
from analysis.figures.robot_pictures import RobotPicture, robot_picture
from analysis.figures.style import PICTURE_ENDING, in_order, label, save
from analysis.measures.load import LeftOut, Run
from analysis.render.picture import Simulate
from schema.errors import RevolveError
from schema.experiment.file import experiment_from_text
from schema.experiment.identity import Origin
from schema.robot.ids import BirthId
from schema.tables.files import read_table

_TREES = {"scenario1": "6.18", "scenario2": "6.19", "scenario3": "6.20"}
_BASELINES = ("no-reproduction", "no-selection")
"""Their robots have no ancestry that selection made."""


class FigureWriter:
    """The figures drawn so far, and those that could not be."""

    def __init__(self, folder: Path) -> None:
        """Draw into a folder that is there; of before are its trees of experiments."""
        self._folder = folder
        for path in folder.glob(f"figure-{_tree_of('*')}.p??"):
            path.unlink()
        self._drawn: list[Drawn] = []
        self.left_out: list[LeftOut] = []

    def add(
        self,
        number: str,
        title: str,
        caption: str,
        source: tuple[str, ...],
        draw: Callable[[], Any],
    ) -> None:
        """Draw a figure and write it, or note why not."""
        try:
            figure = draw()
        except NothingToDraw as error:
            self.leave_out(number, str(error))
            return
        stem = self._folder / f"figure-{number}"
        save(figure, stem)
        picture = stem.with_name(stem.name + PICTURE_ENDING)
        self._drawn.append(Drawn(number, title, caption, source, picture))

    def leave_out(self, number: str, why: str) -> None:
        """Note that there is no such figure, and take away one of before."""
        for path in self._folder.glob(f"figure-{number}.p??"):
            path.unlink()
        self.left_out.append(LeftOut("", f"figure {number}", why))

    @property
    def drawn(self) -> list[Drawn]:
        """The figures in the order of the thesis, then ours."""
        return sorted(self._drawn, key=lambda one: _place(one.number))


def _tree_of(name: str) -> str:
    """Return the number of the tree of an experiment that the thesis has not."""
    return f"G-{name}"


def _place(number: str) -> tuple[bool, list[int], str]:
    digits = [int(part.rstrip("abc")) for part in number.split(".") if part[0] < "A"]
    return not digits, digits, number


def draw_figures(
    tables: Mapping[str, pa.Table],
    runs: Mapping[Path, Run],
    folder: Path,
    simulate: Callable[[], Simulate],
    bar: Progress,
) -> tuple[list[Drawn], list[LeftOut]]:
    """Draw all figures into a folder, as PDF and PNG.

    Args:
        tables: as ``outputs`` names them, and ``benchmark``.
        runs: by their folders.
        folder: is there.
        simulate: returns the worker's simulation, or raises what keeps pictures from
            being drawn.
        bar: shows how far it is.

    Returns:
        What was drawn, in order, and what was left out and why.
    """
    writer = FigureWriter(folder)
    robot_pictures, problems = _robot_pictures(tables["robots"], runs, simulate, bar)
    lineages = [one.lineage for one in robot_pictures if one.family is not None]
    given = {**tables, "lineage": pa.concat_tables([LINEAGE.empty_table(), *lineages])}
    task = bar.add_task("figures drawn", total=len(FIGURES) + len(robot_pictures) + 1)
    for one in FIGURES:
        writer.add(
            one.number, one.title, one.caption, one.source, partial(one.draw, given)
        )
        bar.advance(task)
    _add_gaits(writer, robot_pictures, problems)
    bar.advance(task)
    for name in dict.fromkeys(
        (*_TREES, *(one.best.experiment for one in robot_pictures))
    ):
        found = [one for one in robot_pictures if one.best.experiment == name]
        _add_tree(writer, name, found, problems, tables["robots"])
        bar.advance(task, len(found))
    return writer.drawn, writer.left_out


def _robot_pictures(
    robots: pa.Table,
    runs: Mapping[Path, Run],
    simulate: Callable[[], Simulate],
    bar: Progress,
) -> tuple[list[RobotPicture], dict[str, str]]:
    """Return portraits of the best robots, and of the others why there is none."""
    best = {one.experiment: one for one in best_robots(robots)}
    try:
        simulation = simulate()
    except RevolveError as error:
        return [], dict.fromkeys(best, str(error))
    robot_pictures: list[RobotPicture] = []
    problems: dict[str, str] = {}
    for name in bar.track(in_order(best), description="robots pictured"):
        try:
            robot_pictures.append(_robot_picture(best[name], runs, simulation))
        except RevolveError as error:
            problems[name] = str(error)
    return robot_pictures, problems


def _robot_picture(
    best: Best, runs: Mapping[Path, Run], simulate: Simulate
) -> RobotPicture:
    run = runs[best.folder]
    births = read_table(best.folder, "births")
    return robot_picture(
        best,
        births,
        experiment_from_text(run.document),
        simulate,
        FOUNDERS,
        origin=Origin(seed=run.seed, run=run.number),
        has_family=best.experiment not in _BASELINES,
    )


def _add_gaits(
    writer: FigureWriter,
    robot_pictures: Sequence[RobotPicture],
    problems: Mapping[str, str],
) -> None:
    number, title = "6.10", "Gaits of the best robots"
    for name, why in problems.items():
        writer.leave_out(number, f"{name}: {why}")
    if not robot_pictures:
        if not problems:
            writer.leave_out(number, "nobody was judged")
        return
    caption = (
        "The fittest robot of each experiment's last populations, alone, from the "
        "middle of its evaluation on. Colours tell from which founder a part comes; "
        "white parts came by mutation."
    )
    source = ("robots", THE_BIRTHS)
    writer.add(number, title, caption, source, partial(gaits, robot_pictures))


def _add_tree(
    writer: FigureWriter,
    name: str,
    robot_pictures: Sequence[RobotPicture],
    problems: Mapping[str, str],
    robots: pa.Table,
) -> None:
    """Draw one experiment's best robot and its family, or note why not."""
    number = _TREES.get(name, _tree_of(name))
    if not robot_pictures:
        why = problems.get(name, f"no robot of {name} was judged")
        writer.leave_out(number, why)
        return
    (one,) = robot_pictures
    if one.family is None:
        return
    if len(one.family.levels) == 1:
        writer.leave_out(number, f"the best robot of {name} is a founder")
        return
    mine = robots.filter(pc.field("folder") == str(one.best.folder))
    known = mine.select(["birth_island", "birth", "fitness"]).to_pylist()
    fitness = {
        BirthId(row["birth_island"], row["birth"]): row["fitness"] for row in known
    }
    try:
        levels = ordered_by_dot(one.family.levels, one.family.edges)
    except NoDot:
        levels = ordered(one.family.levels, one.family.edges)
    caption = (
        f"Robot {one.best.birth} of {one.best.folder.name}, the fittest of the last "
        "populations, its parents above it, and so on for five levels (dotted: to a "
        "parent that stands where it is nearest); above the dashed line the founders "
        "whose parts live on in them, whose colours the parts have. White parts came "
        f"by mutation. It has {one.lineage.num_rows - 1} ancestors in all."
    )
    writer.add(
        number,
        f"Ancestry of the best robot of {label(name)}",
        caption,
        ("robots", THE_BIRTHS),
        partial(family_tree, one, levels, fitness),
    )
