"""The section ``[grid]``: cells over a few measures, for selection and figures."""

from collections.abc import Iterator, Mapping
from math import prod
from typing import Annotated

from msgspec import Meta

from schema.errors import nearest, shown
from schema.experiment.section import AtLeastOne, Number, Section

MOST_CELLS = 10_000
"""Most cells of a grid: a population may have an individual in each."""
_EPSILON = 1e-6
"""Added before the division, as pyribs does: 0.3 / 0.1 is less than 3."""

Cell = tuple[int, ...]
"""Numbers of the bins of a cell, in the order of the grid's measures, from 0."""


class Grid(Section, frozen=True):
    """Cells over one to four measures.

    Values beyond the bounds of a measure count to its first or last bin.

    Attributes:
        measures: names of measures, of ``measures.names``.
        bounds: least and greatest value of each [unit of the measure].
        bins: number of equal intervals of each.
        minimised: those of which less is better, in the hypervolume.
        offset: least possible fitness: QD score and hypervolume count what is above it.
    """

    measures: Annotated[tuple[str, ...], Meta(min_length=1, max_length=4)]
    bounds: tuple[tuple[Number, Number], ...]
    bins: tuple[AtLeastOne, ...]
    minimised: tuple[str, ...] = ()
    offset: Number = 0.0


def cell_of(grid: Grid, measures: Mapping[str, float]) -> Cell:
    """Return the cell of an individual with these measures, which are finite.

    Source: ``GridArchive.index_of`` of pyribs 0.12, whose cells they are.
    """
    cell = []
    for name, (low, high), bins in zip(
        grid.measures, grid.bounds, grid.bins, strict=True
    ):
        place = (bins * (measures[name] - low) + _EPSILON) / (high - low)
        cell.append(int(min(max(place, 0), bins - 1)))
    return tuple(cell)


def cell_name(cell: Cell) -> str:
    """Return the name of a cell in tables: ``3/7``."""
    return "/".join(map(str, cell))


def grid_problems(grid: Grid, labels: tuple[str, ...]) -> Iterator[str]:
    """Yield what is wrong with a grid over measures that have these labels."""
    names, bounds, bins = grid.measures, grid.bounds, grid.bins
    for name in names:
        if name not in labels:
            near = nearest(name, labels)
            yield f"grid.measures: {shown(name)} is not in measures.names{near}"
    if not len(set(names)) == len(names) == len(bounds) == len(bins):
        rule = "must be as many as bounds and bins, and differ"
        yield f"grid.measures: {rule}, got {shown(names)}, {len(bounds)}, {len(bins)}"
    for name in set(grid.minimised).difference(names):
        near = nearest(name, names)
        yield f"grid.minimised: {shown(name)} is not in grid.measures{near}"
    for low, high in bounds:
        if low >= high:
            yield f"grid.bounds: must be [least, greatest], got [{low:g}, {high:g}]"
    if prod(bins) > MOST_CELLS:
        yield f"grid.bins: must make <= {MOST_CELLS} cells, got {prod(bins)}"
