"""Draws all figures that the data allows; records why the others are left out."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from glob import escape
from itertools import chain, count
from pathlib import Path

import pyarrow as pa
from rich.progress import Progress

from analysis.figures.archive_maps import MAP, archive_maps, map_figures
from analysis.figures.catalogue import FIGURES, DrawnFigure, Figure
from analysis.figures.family_tree import LINEAGE, Best
from analysis.figures.forms import NothingToDraw, Tables, fitness_units
from analysis.figures.robot_figures import (
    GAITS,
    TREES,
    gait_figures,
    robot_pictures,
    tree_figures,
)
from analysis.figures.robot_pictures import FILM_EVERY_S, RobotPicture
from analysis.figures.style import file_name, in_order, label, save
from analysis.figures.sweeps import sweep_caption, sweep_map
from analysis.measures.load import LeftOut, LoadedRun
from analysis.render.files import gif
from analysis.render.flags import PAGE_ENDING
from analysis.render.picture import Simulate
from analysis.render.stage import Picture

_FILM = "best-robot-of-"
_OF_ROBOTS = (GAITS, "6.17", *TREES.values(), "G")
NUMBERS = (*dict.fromkeys([one.number for one in FIGURES] + [*_OF_ROBOTS, MAP, "S"]),)
"""Numbers of all figures, without the names of experiments."""
MOST_BYTES = 700_000
"""Size of a film up to which it keeps all colours and pictures."""


@dataclass(frozen=True, slots=True)
class Drawings:
    """Files that an analysis drew, figures of the thesis first, and what it did not.

    Films are those of experiments' best robots; ``no_films`` are reasons by experiment.
    """

    figures: list[DrawnFigure]
    films: list[tuple[Best, Path]]
    no_films: dict[str, str]
    left_out: list[LeftOut]


class FigureWriter:
    """Writes figures into a folder.

    Attributes:
        drawn: the figures that were written, in the order of writing.
        left_out: the figures that cannot be drawn, with the reason.
    """

    def __init__(
        self,
        folder: Path,
        wanted: Sequence[str] = (),
        formats: Sequence[str] = ("pdf", "png"),
    ) -> None:
        """Remove files of earlier analyses whose names the experiments determine.

        ``wanted`` are the ``NUMBERS`` that are drawn; all, and films, if it is empty.
        """
        self._folder, self._wanted, self._formats = folder, wanted, formats
        self._taken: set[str] = set()
        for number in "GPS":
            if self.draws(number):
                self._remove(f"{number}-*.*")
        if not wanted:
            self._remove(f"{_FILM}*.*")
        self.drawn: list[DrawnFigure] = []
        self.left_out: list[LeftOut] = []

    def draws(self, *numbers: str) -> bool:
        """Return whether one of some figures is wanted; names may follow numbers."""
        given = (number.partition("-")[0].partition(" ")[0] for number in numbers)
        return not self._wanted or not {*self._wanted}.isdisjoint(given)

    def add(self, figure: Figure, tables: Tables) -> None:
        """Draw a figure and write it, or record why it cannot be drawn.

        One of an earlier analysis is removed.
        """
        if not self.draws(figure.number):
            return
        # Files of experiments are removed already; a name may begin as they do.
        if "-" not in figure.number:
            self._remove(f"{escape(figure.number)}-*.*")
        try:
            drawn = figure.drawn(tables)
        except NothingToDraw as error:
            what = f"figure {figure.number}"
            self.left_out.append(LeftOut("", what, str(error)))
            return
        stem = self._stem(figure.stem)
        picture = save(drawn, stem, self._formats)
        files = [stem.with_name(f"{stem.name}.{kind}") for kind in self._formats]
        caption = figure.caption
        text = caption if isinstance(caption, str) else caption(tables)
        words = f"{figure.title}. {text}".strip() + "\n"
        stem.with_name(f"{stem.name}.txt").write_text(words, "utf-8")
        self.drawn.append(DrawnFigure(figure, text, files, picture))

    def add_film(self, robot: RobotPicture) -> tuple[Best, Path]:
        """Write the moving picture of a robot, and beside it its page."""
        stem = self._stem(f"{_FILM}{robot.best.experiment}")
        path = stem.with_name(f"{stem.name}.gif")
        path.write_bytes(film(robot.film, FILM_EVERY_S))
        path.with_suffix(PAGE_ENDING).write_text(robot.page, "utf-8")
        return robot.best, path

    def _stem(self, text: str) -> Path:
        """Return a path without ending, distinct also where case does not count."""
        name = file_name(text)
        numbered = (f"{name}-{number}" for number in count(2))
        free = next(
            stem
            for stem in chain([name], numbered)
            if stem.casefold() not in self._taken
        )
        self._taken.add(free.casefold())
        return self._folder / free

    def _remove(self, pattern: str) -> None:
        for path in self._folder.glob(pattern):
            path.unlink()


def film(pictures: Sequence[Picture], interval_s: float) -> bytes:
    """Return pictures as a GIF that repeats.

    A film above ``MOST_BYTES`` gets fewer colours, then every other picture is left
    out.
    """
    shown = list(pictures)
    while True:
        for colours in (128, 64, 32):
            stored = gif(shown, interval_s, colours)
            if len(stored) <= MOST_BYTES:
                return stored
        if len(shown) == 1:
            return stored
        shown, interval_s = shown[::2], 2 * interval_s


def _place(drawn: DrawnFigure) -> tuple[bool, list[int], str]:
    """Return the sort key that puts the figures of the thesis first."""
    number = drawn.figure.number
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
    *,
    wanted: Sequence[str] = (),
    formats: Sequence[str] = ("pdf", "png"),
) -> Drawings:
    """Draw figures into a folder, and the best robots as GIF.

    ``tables`` are those of ``outputs``, and ``benchmark``; ``simulate`` returns the
    worker's simulation, or raises why robots cannot be drawn; ``wanted`` and
    ``formats`` are those of ``FigureWriter``.
    """
    writer = FigureWriter(folder, wanted, formats)
    lines: dict[str, pa.Table] = {}
    pictures, problems = (
        robot_pictures(tables["robots"], runs, simulate, bar, lines)
        if writer.draws(*_OF_ROBOTS)
        else ({}, {})
    )
    lineages = [LINEAGE.empty_table(), *lines.values()]
    given = {**tables, "lineage": pa.concat_tables(lineages)}
    units = fitness_units(tables)
    reached = tables.get("cells") if writer.draws(MAP) else None
    maps, no_maps = archive_maps(reached, runs) if reached else ([], {})
    every = [
        *FIGURES,
        *_sweeps(tables),
        *map_figures(maps, no_maps, units),
        *gait_figures([*pictures.values()], problems, units),
        *tree_figures(pictures, problems, lines, tables["robots"], units),
    ]
    for figure in bar.track(every, description="drawing figures"):
        writer.add(figure, given)
    films = [writer.add_film(one) for one in pictures.values() if not wanted]
    figures = sorted(writer.drawn, key=_place)
    return Drawings(figures, films, problems, writer.left_out)


def _sweeps(tables: Tables) -> Iterator[Figure]:
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
