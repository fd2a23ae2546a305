"""Archive maps: the fittest robot of each cell of a grid, seen from above."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from math import prod
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
from matplotlib import colormaps
from matplotlib import figure as drawing
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.collections import PolyCollection
from matplotlib.colors import LinearSegmentedColormap, Normalize, to_hex
from matplotlib.ticker import MaxNLocator

from analysis.figures.catalogue import BIRTHS, Figure, missing
from analysis.figures.courses import with_unit
from analysis.figures.forms import Tables
from analysis.figures.look import INK, LOOK
from analysis.figures.robot_pictures import shown_experiment
from analysis.figures.style import in_order, label
from analysis.measures.load import LoadedRun
from analysis.measures.population_table import individual_ids, rows_of
from analysis.render.plan import Outline, plan
from schema.errors import RevolveError
from schema.experiment.document import body_space
from schema.experiment.grid import Grid
from schema.tables.files import read_table
from schema.wire.born import robot_of_birth

MAP = "P"
"""Number of the figures, before the names of experiments."""
_PALE = LinearSegmentedColormap.from_list("pale", colormaps["Blues"]([0.1, 0.55]))
"""Colours of fitness, on which robots are dark."""
_SHARE = 0.86
"""Share of a cell's width that a robot takes."""
_MOST_IN = 8.0
"""Greatest height of the cells together [inches]."""
_LEFT_IN, _RIGHT_IN, _BELOW_IN = 0.65, 0.85, 0.5
"""Space for the texts of axes [inches]."""
_SQUARE = np.array([(0, 0), (1, 0), (1, 1), (0, 1)])
_Row = dict[str, Any]


@dataclass(frozen=True, slots=True)
class MapCell:
    """A cell: numbers of its bins, fitness, name and outlines of its fittest robot."""

    x: int
    y: int
    fitness: float
    robot: str
    outlines: Sequence[Outline]


@dataclass(frozen=True, slots=True)
class ArchiveMap:
    """Map of a run over the first two measures of its grid; with one, of one row.

    Attributes:
        experiment, folder: of the run.
        grid: cells of the experiment.
        cells: those that were reached.
        reached: number of cells that were reached, over all measures.
    """

    experiment: str
    folder: Path
    grid: Grid
    cells: Sequence[MapCell]
    reached: int

    @property
    def bins(self) -> tuple[int, int]:
        """Number of cells along x and y."""
        across, along = (*self.grid.bins, 1)[:2]
        return across, along

    @property
    def scale(self) -> Normalize:
        """Fitness as a share of the range of the cells' fitness."""
        fitness = [cell.fitness for cell in self.cells]
        return Normalize(min(fitness), max(fitness))

    def colour(self, cell: MapCell) -> str:
        """Return the colour of a cell."""
        return str(to_hex(_PALE(self.scale(cell.fitness))))


def archive_maps(
    cells: pa.Table, runs: Mapping[Path, LoadedRun]
) -> tuple[list[ArchiveMap], dict[str, str]]:
    """Return a map for each experiment, and why others have none.

    It is that of the run with the most cells; of equals, that with the fittest robots.

    Args:
        cells: as ``outputs``.
        runs: by folder.
    """
    of_runs: dict[str, list[_Row]] = {}
    for row in cells.to_pylist():
        of_runs.setdefault(row["folder"], []).append(row)
    maps, problems = [], {}
    for name in in_order(cells["experiment"].to_pylist()):
        mine = [rows for rows in of_runs.values() if rows[0]["experiment"] == name]
        try:
            maps.append(_map(max(mine, key=_fullness), runs))
        except RevolveError as error:
            problems[name] = str(error)
    return maps, problems


def _fullness(rows: Sequence[_Row]) -> tuple[int, float]:
    return len({row["cell"] for row in rows}), sum(row["fitness"] for row in rows)


def _map(rows: Sequence[_Row], runs: Mapping[Path, LoadedRun]) -> ArchiveMap:
    run, best = runs[Path(rows[0]["folder"])], dict[tuple[int, int], _Row]()
    grid = run.settings.grid
    assert grid is not None
    for row in sorted(rows, key=lambda row: (-row["fitness"], row["birth"])):
        x, y, *_ = (*map(int, row["cell"].split("/")), 0)
        best.setdefault((x, y), row)
    made = [
        MapCell(*at, row["fitness"], f"{row['birth_island']}:{row['birth']}", outlines)
        for (at, row), outlines in zip(
            best.items(), _outlines(run, [*best.values()]), strict=True
        )
    ]
    return ArchiveMap(run.experiment, run.folder, grid, made, _fullness(rows)[0])


def _outlines(run: LoadedRun, robots: list[_Row]) -> list[list[Outline]]:
    experiment = shown_experiment(run)
    space = body_space(experiment.space)
    births = read_table(run.folder, "births", ["island", "birth", "genome", "robot"])
    places = rows_of(individual_ids(pa.Table.from_pylist(robots)), births)
    return [
        plan(robot_of_birth(row["genome"], row["robot"], experiment), space)
        for row in births.take(pa.array(places)).to_pylist()
    ]


def map_figures(
    maps: Sequence[ArchiveMap], problems: Mapping[str, str], units: Mapping[str, str]
) -> Iterator[Figure]:
    """Yield a figure of each map, and the maps that are missing."""
    for name, why in problems.items():
        yield missing(f"{MAP}-{name}", why)
    for one in maps:
        yield Figure(
            f"{MAP}-{one.experiment}",
            f"Archive map of {label(one.experiment)}",
            map_caption(one),
            ("cells", BIRTHS),
            partial(draw_map, one=one, unit=units.get(one.experiment, "")),
            "diversity",
            f"archive-map-of-{one.experiment}",
            texts=map_texts(one),
        )


def map_caption(one: ArchiveMap) -> str:
    """Return what a map shows."""
    scale, others = one.scale, " and ".join(one.grid.measures[2:])
    over = f" Each is the fittest over all bins of {others}." * bool(others)
    return (
        f"The fittest robot of each cell that births of {one.folder.name} reached, "
        f"{one.reached} of {prod(one.grid.bins)} cells, seen from above: black its "
        "core, red parts with a motor, yellow other joints, grey all else. Robots are "
        "not to one scale. The darker a cell, the greater the fitness, "
        f"{scale.vmin:.3g} to {scale.vmax:.3g}.{over}"
    )


def draw_map(_: Tables, one: ArchiveMap, unit: str) -> drawing.Figure:
    """Return the picture of a map; ``unit`` is that of fitness."""
    across, along = one.bins
    side = min((LOOK.get().width_in - _LEFT_IN - _RIGHT_IN) / across, _MOST_IN / along)
    wide, tall = _LEFT_IN + side * across + _RIGHT_IN, _BELOW_IN + side * along + 0.1
    figure = drawing.Figure(figsize=(wide, tall))
    left, below = _LEFT_IN / wide, _BELOW_IN / tall
    width, height = side * across / wide, side * along / tall
    axes = figure.add_axes((left, below, width, height))
    for cell in one.cells:
        corner = np.array([cell.x, cell.y])
        robot = [corner + 0.5 + _SHARE * each.corners for each in cell.outlines]
        paint = [each.colour for each in cell.outlines]
        # A thin edge closes the gaps between boxes of a part.
        axes.add_collection(
            PolyCollection(
                [_SQUARE + corner, *robot],
                facecolors=[one.colour(cell), *paint],
                edgecolors=["white", *paint],
                linewidths=[1.0, *(0.2 for _ in paint)],
                gid=f"robot-{cell.x}/{cell.y}",
                clip_on=False,
            )
        )
    _label_axes(axes, one)
    beside = (left + width + 0.1 / wide, below, 0.13 / wide, height)
    shades_of = ScalarMappable(one.scale, _PALE)
    bar = figure.colorbar(shades_of, cax=figure.add_axes(beside))
    bar.set_label(f"fitness [{unit}]" if unit else "fitness", color=INK)
    bar.outline.set_visible(False)
    return figure


def map_texts(one: ArchiveMap) -> dict[str, str]:
    """Return robot, fitness and bins of each cell of a map, by its ``gid``."""
    grid, texts = one.grid, {}
    for cell in one.cells:
        lines = [f"robot {cell.robot}: fitness {cell.fitness:.3g}"]
        for name, (low, high), bins, at in zip(
            grid.measures, grid.bounds, one.bins, (cell.x, cell.y), strict=False
        ):
            step = (high - low) / bins
            lines.append(f"{name} {low + at * step:.3g} to {low + (at + 1) * step:.3g}")
        texts[f"robot-{cell.x}/{cell.y}"] = "\n".join(lines)
    return texts


def _label_axes(axes: Axes, one: ArchiveMap) -> None:
    axes.set(xlim=(0, one.bins[0]), ylim=(0, one.bins[1]))
    axes.yaxis.set_visible(len(one.grid.measures) > 1)
    for axis, name, (low, high), bins in zip(
        (axes.xaxis, axes.yaxis), one.grid.measures, one.grid.bounds, one.bins,
        strict=False,
    ):  # fmt: skip
        values = MaxNLocator(6, steps=[1, 2, 5, 10]).tick_values(low, high)
        marked = [value for value in map(float, values) if low <= value <= high]
        places = [(value - low) / (high - low) * bins for value in marked]
        axis.set_ticks(places, [f"{value:g}" for value in marked])
        axis.set_label_text(with_unit(name))
    axes.tick_params(colors=INK, length=2)
