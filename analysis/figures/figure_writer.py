"""Draws all figures that the data allows; records why the others are left out."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from glob import escape
from pathlib import Path

import pyarrow as pa
import pyarrow.compute as pc
from rich.progress import Progress

from analysis.figures.catalogue import BIRTHS, FIGURES, DrawnFigure, Figure
from analysis.figures.family_tree import (
    LINEAGE,
    Best,
    best_robots,
    lineage,
    row_of,
)
from analysis.figures.file_names import FileNames
from analysis.figures.films import film
from analysis.figures.forms import NothingToDraw, Tables, fitness_units
from analysis.figures.pictures import family_tree, gaits
from analysis.figures.robot_pictures import (
    RobotPicture,
    robot_picture,
    shown_document,
)
from analysis.figures.style import PICTURE_ENDING, in_order, label, save
from analysis.figures.sweeps import sweep_caption, sweep_map
from analysis.measures.families import family
from analysis.measures.load import LeftOut, LoadedRun
from analysis.render.picture import Simulate
from schema.errors import RevolveError
from schema.experiment.file import experiment_from_text
from schema.experiment.identity import Origin
from schema.plugins.source import modules_named
from schema.robot.ids import BirthId
from schema.tables.description import allow_plugins_of
from schema.tables.learnt import learnt_births

_TREES = {"scenario1": "6.18", "scenario2": "6.19", "scenario3": "6.20"}
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
_FILM = "best-robot-of-"


@dataclass(frozen=True, slots=True)
class Film:
    """A moving picture of an experiment's best robot."""

    best: Best
    path: Path


@dataclass(frozen=True, slots=True)
class Drawings:
    """Files that an analysis drew.

    Attributes:
        figures: figures, those of the thesis first.
        films: moving pictures, in the order of experiments.
        no_films: reasons why experiments have none, by experiment.
        left_out: figures that cannot be drawn, with the reason.
    """

    figures: list[DrawnFigure]
    films: list[Film]
    no_films: dict[str, str]
    left_out: list[LeftOut]


class FigureWriter:
    """Writes figures into a folder.

    Attributes:
        drawn: the figures that were written, in the order of writing.
        left_out: the figures that cannot be drawn, with the reason.
    """

    def __init__(self, folder: Path) -> None:
        """Remove files of earlier analyses whose names the experiments determine.

        Args:
            folder: an existing folder.
        """
        self._folder = folder
        self._names = FileNames()
        for pattern in ("G-*.p??", "S-*.p??", f"{_FILM}*.gif"):
            self._remove(pattern)
        self.drawn: list[DrawnFigure] = []
        self.left_out: list[LeftOut] = []

    def add(self, figure: Figure, tables: Tables) -> None:
        """Draw a figure and write it, or record why it cannot be drawn.

        One of an earlier analysis is removed then.
        """
        try:
            drawn = figure.drawn(tables)
        except NothingToDraw as error:
            # Files of experiments are removed already; a name may begin as they do.
            if "-" not in figure.number:
                self._remove(f"{escape(figure.number)}-*.p??")
            what = f"figure {figure.number}"
            self.left_out.append(LeftOut("", what, str(error)))
            return
        stem = self._folder / self._names.add(figure.stem)
        save(drawn, stem)
        picture = stem.with_name(stem.name + PICTURE_ENDING)
        caption = figure.caption
        text = caption if isinstance(caption, str) else caption(tables)
        self.drawn.append(DrawnFigure(figure, text, picture))

    def add_film(self, one: RobotPicture) -> Film:
        """Write the moving picture of a robot."""
        name = self._names.add(f"{_FILM}{one.best.experiment}")
        path = self._folder / f"{name}.gif"
        path.write_bytes(film(one.film, one.film_interval_s))
        return Film(one.best, path)

    def _remove(self, pattern: str) -> None:
        for path in self._folder.glob(pattern):
            path.unlink()


def _tree_number(experiment: str) -> str:
    """Return the number of an experiment's family tree."""
    return _TREES.get(experiment, f"G-{experiment}")


def _place(one: DrawnFigure) -> tuple[bool, list[int], str]:
    """Return the sort key that puts the figures of the thesis first."""
    number = one.figure.number
    # The name of an experiment may follow.
    parts = number.partition("-")[0].split(".")
    digits = [int(part.rstrip("abc")) for part in parts if part[0] < "A"]
    return not digits, digits, number


def draw_figures(
    tables: Mapping[str, pa.Table],
    runs: Mapping[Path, LoadedRun],
    folder: Path,
    simulate: Callable[[], Simulate],
    bar: Progress,
) -> Drawings:
    """Draw all figures into a folder, as PDF and PNG, and the best robots as GIF.

    Args:
        tables: by the names of ``outputs``, and ``benchmark``.
        runs: by their folders.
        folder: an existing folder.
        simulate: returns the worker's simulation, or raises the reason why robots
            cannot be rendered.
        bar: shows progress.
    """
    writer = FigureWriter(folder)
    lines: dict[str, pa.Table] = {}
    pictures, problems = _robot_pictures(tables["robots"], runs, simulate, bar, lines)
    lineages = [LINEAGE.empty_table(), *lines.values()]
    given = {**tables, "lineage": pa.concat_tables(lineages)}
    units = fitness_units(tables)
    every = [
        *FIGURES,
        *_sweeps(tables),
        *_gaits([*pictures.values()], problems, units),
        *_trees(pictures, problems, lines, tables["robots"], units),
    ]
    for figure in bar.track(every, description="drawing figures"):
        writer.add(figure, given)
    films = [writer.add_film(one) for one in pictures.values()]
    figures = sorted(writer.drawn, key=_place)
    return Drawings(figures, films, problems, writer.left_out)


def _missing(number: str, why: str) -> Figure:
    """Return a figure that cannot be drawn."""
    return Figure(number, "", "", ("",), list, "robots", nothing=why)


def _sweeps(tables: Tables) -> Iterator[Figure]:
    """Yield the map of each sweep."""
    rows = tables.get("sweeps")
    for name in in_order(rows["experiment"].to_pylist() if rows else ()):
        yield Figure(
            f"S-{name}",
            f"Outcomes of the sweep {label(name)}",
            partial(sweep_caption, experiment=name),
            ("sweeps", "outcomes"),
            partial(sweep_map, experiment=name),
            "sweeps",
            f"sweep-{name}",
        )


def _robot_pictures(
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
            document = shown_document(run.document)
            if modules_named(document.encode()):
                allow_plugins_of(run.folder)
            births = learnt_births(run.folder)
            row = row_of(best[name], births)
            pictures[name] = robot_picture(
                best[name],
                births,
                family(births, row),
                experiment_from_text(document, is_own=True),
                simulation,
                origin=Origin(seed=run.seed, run=run.number),
                has_family=name not in _BASELINES,
            )
            if name not in _BASELINES:
                lines[name] = lineage(births, name, row)
        except RevolveError as error:
            problems[name] = str(error)
    return pictures, problems


def _gaits(
    pictures: Sequence[RobotPicture],
    problems: Mapping[str, str],
    units: Mapping[str, str],
) -> Iterator[Figure]:
    """Yield the figure of gaits, and what is missing in it."""
    for name, why in problems.items():
        yield _missing(f"{GAITS} of {name}", why)
    if not pictures and not problems:
        yield _missing(GAITS, "no evaluated robot is in a recorded population")
    if pictures:
        yield Figure(
            GAITS,
            "Gaits of the best robots",
            "The fittest robot of each experiment's last populations, simulated alone "
            "and shown from the middle of its evaluation on, by a camera that stands "
            "still; a tile of the floor has 20 cm. Pictures of robots that move less "
            "than 10 cm in that time are taken further apart, up to the end of the "
            f"evaluation. {PART_COLOURS}",
            _SOURCE,
            lambda _: gaits(pictures, units),
            "robots",
        )


def _trees(
    pictures: Mapping[str, RobotPicture],
    problems: Mapping[str, str],
    lines: Mapping[str, pa.Table],
    robots: pa.Table,
    units: Mapping[str, str],
) -> Iterator[Figure]:
    """Yield the family of each best robot but those of baselines."""
    for name in dict.fromkeys((*_TREES, *pictures)):
        if name in lines:
            ancestors = lines[name].num_rows - 1
            yield _tree(pictures[name], ancestors, robots, units.get(name, ""))
        elif name not in pictures:
            why = f"no evaluated robot of {name} is in a recorded population"
            yield _missing(_tree_number(name), problems.get(name, why))


def _tree(one: RobotPicture, ancestors: int, robots: pa.Table, unit: str) -> Figure:
    """Return the figure of one experiment's best robot and its family."""
    best, relatives = one.best, one.family
    assert relatives is not None
    number = _tree_number(best.experiment)
    if len(relatives.levels) == 1:
        return _missing(number, f"the best robot of {best.experiment} is a founder")
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
        lambda _: family_tree(one, relatives, fitness, unit),
        "robots",
        f"ancestry-of-{best.experiment}",
    )
