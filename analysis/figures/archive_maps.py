"""Archive maps: the fittest robot of each cell of a grid, seen from above."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
from matplotlib import colormaps
from matplotlib import figure as drawing
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.collections import PolyCollection
from matplotlib.colors import LinearSegmentedColormap, Normalize, to_hex
from matplotlib.ticker import MaxNLocator

from analysis.figures.catalogue import BIRTHS, Figure, missing
from analysis.figures.courses import UNITS
from analysis.figures.forms import Tables
from analysis.figures.robot_pictures import shown_document
from analysis.figures.style import INK, WIDTH_IN, in_order, label
from analysis.measures.load import LoadedRun
from analysis.measures.population_table import individual_ids, rows_of
from analysis.render.plan import Outline, plan
from schema.errors import RevolveError
from schema.experiment.document import body_space
from schema.experiment.file import experiment_from_text
from schema.experiment.grid import Grid
from schema.plugins.source import modules_named
from schema.tables.description import allow_plugins_of
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


@dataclass(frozen=True, slots=True)
class MapCell:
    """A cell of a map, and its fittest robot.

    Attributes:
        x, y: number of the bin.
        fitness: of the robot.
        robot: its island of birth and number of birth, such as 0:12.
        outlines: of the robot.
        colour: of its fitness.
    """

    x: int
    y: int
    fitness: float
    robot: str
    outlines: Sequence[Outline]
    colour: str


@dataclass(frozen=True, slots=True)
class ArchiveMap:
    """Map of a run over the first two measures of its grid; with one, of one row.

    Attributes:
        experiment, folder: of the run.
        grid: cells of the experiment.
        cells: those that were reached, by bins.
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
    def fitness_range(self) -> tuple[float, float]:
        """Least and greatest fitness of the cells."""
        fitness = [cell.fitness for cell in self.cells]
        return min(fitness), max(fitness)


def archive_maps(
    cells: pa.Table, runs: Mapping[Path, LoadedRun]
) -> tuple[list[ArchiveMap], dict[str, str]]:
    """Return a map for each experiment, and why others have none.

    It is that of the run with the most cells; of equals, that with the fittest robots.

    Args:
        cells: as ``outputs``.
        runs: by folder.
    """
    maps, problems = [], {}
    for name in in_order(cells["experiment"].to_pylist()):
        mine = cells.filter(pc.field("experiment") == name)
        folder = _fullest(mine)
        of_run = mine.filter(pc.field("folder") == folder)
        try:
            maps.append(_map(of_run, runs[Path(folder)]))
        except RevolveError as error:
            problems[name] = str(error)
    return maps, problems


def _fullest(cells: pa.Table) -> str:
    best = cells.group_by(["folder", "cell"]).aggregate([("fitness", "max")])
    runs = best.group_by("folder").aggregate(
        [("cell", "count"), ("fitness_max", "sum")]
    )
    keys = [("cell_count", "descending"), ("fitness_max_sum", "descending"),
            ("folder", "ascending")]  # fmt: skip
    return str(runs.sort_by(keys)["folder"][0].as_py())


def _map(cells: pa.Table, run: LoadedRun) -> ArchiveMap:
    grid = run.settings.grid
    assert grid is not None
    best: dict[tuple[int, int], dict[str, object]] = {}
    ordered = cells.sort_by([("fitness", "descending"), ("birth", "ascending")])
    for row in ordered.to_pylist():
        x, y, *_ = (*map(int, row["cell"].split("/")), 0)
        best.setdefault((x, y), row)
    spots = sorted(best)
    chosen = pa.Table.from_pylist([best[spot] for spot in spots], cells.schema)
    outlines = _outlines(run, chosen)
    fitness = chosen["fitness"].to_pylist()
    shade = Normalize(min(fitness), max(fitness))
    names = [
        f"{island}:{birth}"
        for island, birth in zip(
            *(chosen[key].to_pylist() for key in ("birth_island", "birth")), strict=True
        )
    ]
    made = [
        MapCell(x, y, value, name, drawn, to_hex(_PALE(shade(value))))
        for (x, y), value, name, drawn in zip(
            spots, fitness, names, outlines, strict=True
        )
    ]
    reached = len(set(cells["cell"].to_pylist()))
    return ArchiveMap(run.experiment, run.folder, grid, made, reached)


def _outlines(run: LoadedRun, robots: pa.Table) -> list[list[Outline]]:
    document = shown_document(run.document)
    if modules_named(document.encode()):
        allow_plugins_of(run.folder)
    experiment = experiment_from_text(document, is_own=True)
    space = body_space(experiment.space)
    births = read_table(run.folder, "births", ["island", "birth", "genome", "robot"])
    rows = births.take(pa.array(rows_of(individual_ids(robots), births)))
    pairs = zip(rows["genome"].to_pylist(), rows["robot"].to_pylist(), strict=True)
    return [
        plan(robot_of_birth(genome, stored, experiment), space)
        for genome, stored in pairs
    ]


def map_figures(
    maps: Sequence[ArchiveMap], problems: Mapping[str, str], units: Mapping[str, str]
) -> Iterator[Figure]:
    """Yield a figure of each map, and the maps that are missing."""
    for name, why in problems.items():
        yield missing(f"{MAP}-{name}", why)
    for one in maps:
        unit = units.get(one.experiment, "")
        yield Figure(
            f"{MAP}-{one.experiment}",
            f"Archive map of {label(one.experiment)}",
            map_caption(one),
            ("cells", BIRTHS),
            partial(_drawn, one=one, unit=unit),
            "diversity",
            f"archive-map-of-{one.experiment}",
        )


def _drawn(_: Tables, one: ArchiveMap, unit: str) -> drawing.Figure:
    return draw_map(one, unit)


def map_caption(one: ArchiveMap) -> str:
    """Return what a map shows."""
    others = one.grid.measures[2:]
    over = f" Each is the fittest over all bins of {' and '.join(others)}." if others \
        else ""  # fmt: skip
    total = int(np.prod(one.grid.bins))
    least, most = one.fitness_range
    return (
        f"The fittest robot of each cell that births of {one.folder.name} reached, "
        f"{one.reached} of {total} cells, seen from above: black its core, red parts "
        "with a motor, yellow other joints, grey all else. Robots are not to one "
        f"scale. The darker a cell, the greater the fitness, {least:.3g} to {most:.3g}."
        f"{over}"
    )


def draw_map(one: ArchiveMap, unit: str) -> drawing.Figure:
    """Return the picture of a map; ``unit`` is that of fitness."""
    across, along = one.bins
    side = min((WIDTH_IN - _LEFT_IN - _RIGHT_IN) / across, _MOST_IN / along)
    wide, tall = _LEFT_IN + side * across + _RIGHT_IN, _BELOW_IN + side * along + 0.1
    figure = drawing.Figure(figsize=(wide, tall))
    edges = (_LEFT_IN / wide, _BELOW_IN / tall)
    size = (side * across / wide, side * along / tall)
    axes = figure.add_axes((*edges, *size))
    _add_cells(axes, one)
    axes.set(xlim=(0, across), ylim=(0, along), aspect="equal")
    axes.set_axisbelow(True)
    for axis, name, (low, high), bins in zip(
        (axes.xaxis, axes.yaxis), one.grid.measures, one.grid.bounds, one.bins,
        strict=False,
    ):  # fmt: skip
        values = MaxNLocator(min(bins, 6), steps=[1, 2, 5, 10]).tick_values(low, high)
        shown = [value for value in values if low <= value <= high]
        places = [(value - low) / (high - low) * bins for value in shown]
        axis.set_ticks(places, [f"{value:g}" for value in shown])
        axis.set_label_text(axis_label(name))
    if len(one.grid.measures) == 1:
        axes.yaxis.set_visible(False)
    axes.tick_params(colors=INK, length=2)
    for line in axes.spines.values():
        line.set(color="#999999", linewidth=0.6)
    beside = (edges[0] + size[0] + 0.1 / wide, edges[1], 0.13 / wide, size[1])
    shades = ScalarMappable(Normalize(*one.fitness_range), _PALE)
    bar = figure.colorbar(shades, cax=figure.add_axes(beside))
    bar.set_label(f"fitness [{unit}]" if unit else "fitness", color=INK)
    bar.outline.set_visible(False)
    return figure


def axis_label(measure: str) -> str:
    """Return the name of a measure with its unit, if it has one."""
    unit = UNITS.get(measure)
    return f"{measure} [{unit}]" if unit else measure


def _add_cells(axes: Axes, one: ArchiveMap) -> None:
    square = np.array([(0, 0), (1, 0), (1, 1), (0, 1)])
    cells = [square + np.array([cell.x, cell.y]) for cell in one.cells]
    shades = [cell.colour for cell in one.cells]
    axes.add_collection(
        PolyCollection(cells, facecolors=shades, edgecolors="#FFFFFF", linewidths=0.6)
    )
    pairs = [(cell, outline) for cell in one.cells for outline in cell.outlines]
    shapes = [
        _SHARE * outline.corners + np.array([cell.x + 0.5, cell.y + 0.5])
        for cell, outline in pairs
    ]
    paint = [outline.colour for _, outline in pairs]
    # A thin edge closes the gaps between boxes of a part.
    axes.add_collection(
        PolyCollection(shapes, facecolors=paint, edgecolors=paint, linewidths=0.2)
    )
