"""Cells of a grid that births have reached: archives, their scores, and entropies."""

import math
from collections import Counter, defaultdict
from collections.abc import Iterator

import numpy as np
import pyarrow as pa

from analysis.measures.diversity.fronts import added_volume, front
from analysis.measures.diversity.samples import Samples
from analysis.measures.outputs import run_schema
from analysis.measures.population_table import Numbers, PopulationTable
from analysis.measures.run_tables import RunTables
from schema.experiment.grid import Cell, Grid, cell_name, cell_of
from schema.robot.trees import Integers

NEAREST = 5
"""Neighbours whose mean distance is a robot's novelty."""
_MOST_OBJECTIVES = 3
"""Objectives up to which a hypervolume is computed: it takes long with more."""
_COURSES = ("coverage", "qd_score", "archive_entropy", "hypervolume")


class Archive:
    """The fittest of each cell, of all robots that were added; of equals the elder.

    Source: Mouret and Clune 2015, "Illuminating search spaces by mapping elites"; the
    archive of pyribs, without a learning rate.

    Attributes:
        elites: index of the fittest robot of each cell, in the order of adding.
        counts: number of robots of each cell.
        qd_score: sum over cells of the fitness above the grid's offset.
    """

    def __init__(self, grid: Grid) -> None:
        self.grid = grid
        self.elites: dict[Cell, int] = {}
        self.counts: Counter[Cell] = Counter()
        self.qd_score = 0.0
        self._fitness: dict[Cell, float] = {}
        self._front: Numbers = np.empty((0, 1 + len(grid.measures)))
        self._is_minimised = np.isin(grid.measures, grid.minimised)
        self._logs = self._volume = 0.0

    def add(self, index: int, fitness: float, values: Numbers) -> None:
        """Add a robot with its measures, (M,)."""
        grid = self.grid
        cell = cell_of(grid, dict(zip(grid.measures, values.tolist(), strict=True)))
        count = self.counts[cell]
        self._logs += _n_log_n(count + 1) - _n_log_n(count)
        self.counts[cell] = count + 1
        last = self._fitness.get(cell)
        if last is None or fitness > last:
            self.qd_score += fitness - (grid.offset if last is None else last)
            self._fitness[cell], self.elites[cell] = fitness, index
        within = shares(grid, values)
        if 1 + len(values) <= _MOST_OBJECTIVES and fitness > grid.offset:
            worth = np.where(self._is_minimised, 1.0 - within, within)
            point = np.append(worth, fitness - grid.offset)
            if added := added_volume(self._front, point):
                self._volume += added
                self._front = front(np.vstack([self._front, point]))

    @property
    def scores(self) -> tuple[float, ...]:
        """Coverage, QD score, entropy and hypervolume."""
        total = self.counts.total()
        entropy = math.log(total) - self._logs / total if total else 0.0
        volume = self._volume if self._front.shape[1] <= _MOST_OBJECTIVES else math.nan
        share = len(self.elites) / math.prod(self.grid.bins)
        return share, self.qd_score, max(0.0, entropy), volume


def shares(grid: Grid, values: Numbers) -> Numbers:
    """Return measures, (..., M), as shares of their ranges, 0 to 1."""
    low, high = np.array(grid.bounds).T
    within: Numbers = np.clip((values - low) / (high - low), 0.0, 1.0)
    return within


def _n_log_n(count: int) -> float:
    return count * math.log(count) if count else 0.0


def grid_measures(run: RunTables) -> dict[str, Numbers]:
    """Return the measures of populations that need a grid, (G,) each.

    They are empty without a grid, and without a robot that has its measures.
    """
    grid, born = run.grid, run.samples
    if grid is None or born is None or not len(born):
        return {}
    table = run.population_table
    columns = {name: np.full(len(table), np.nan) for name in _COURSES}
    for island in np.unique(table.islands).tolist():
        mine = born.born_on(island)
        groups = np.flatnonzero(table.islands == island)
        at = np.searchsorted(mine.births, table.births[groups], side="right")
        courses = np.array(list(_scores(grid, mine)))
        for name, course in zip(_COURSES, courses.T, strict=True):
            columns[name][groups] = course[at]
    return columns | _of_living(grid, born, table)


def _scores(grid: Grid, born: Samples) -> Iterator[tuple[float, ...]]:
    """Yield the scores of the empty archive, then those after each sample."""
    archive = Archive(grid)
    yield archive.scores
    for index, (fitness, values) in enumerate(
        zip(born.fitness.tolist(), born.values, strict=True)
    ):
        archive.add(index, fitness, values)
        yield archive.scores


def _of_living(grid: Grid, born: Samples, table: PopulationTable) -> dict[str, Numbers]:
    """Return entropy over cells, and novelty, of the members with measures."""
    last = born.of_members(table)
    places = shares(grid, born.values)
    entropy, novelties = (np.full(len(table), np.nan) for _ in range(2))
    cells = _cells(grid, born)
    for group, members in enumerate(table.living):
        rows = last[members]
        rows = rows[rows >= 0]
        if not len(rows):
            continue
        counts = np.unique(cells[rows], return_counts=True)[1] / len(rows)
        entropy[group] = abs(float((counts * np.log(counts)).sum()))
        if len(rows) > 1:
            novelties[group] = novelty(places[rows])
    return {"cell_entropy": entropy, "novelty": novelties}


def _cells(grid: Grid, born: Samples) -> Integers:
    """Return the number of each sample's cell, (S,)."""
    named = (dict(zip(grid.measures, row, strict=True)) for row in born.values.tolist())
    cells = np.array([cell_of(grid, measures) for measures in named], np.int64)
    numbers: Integers = np.ravel_multi_index(tuple(cells.T), grid.bins)
    return numbers


def novelty(places: Numbers) -> float:
    """Return the mean distance of N > 1 places, (N, M), to their nearest neighbours.

    Source: Lehman and Stanley 2011, "Abandoning objectives", of a population alone.
    """
    apart = places[:, np.newaxis] - places
    distances = np.sqrt((apart * apart).sum(axis=2))
    nearest = min(NEAREST, len(places) - 1)
    # The first of each row is the distance to itself.
    return float(np.sort(distances, axis=1)[:, 1 : 1 + nearest].mean())


def cells(run: RunTables) -> pa.Table:
    """Return the fittest robot of each cell that the births of an island reached."""
    grid, born = run.grid, run.samples
    assert grid is not None
    assert born is not None
    columns: dict[str, list[object]] = defaultdict(list)
    for island in np.unique(born.islands).tolist():
        mine, archive = born.born_on(island), Archive(grid)
        pairs = zip(mine.fitness.tolist(), mine.values, strict=True)
        for index, (fitness, values) in enumerate(pairs):
            archive.add(index, fitness, values)
        for cell, index in sorted(archive.elites.items()):
            columns["island"].append(island)
            columns["cell"].append(cell_name(cell))
            columns["robot"].append(int(mine.robots[index]))
            columns["fitness"].append(float(mine.fitness[index]))
            columns["births"].append(int(mine.births[index]))
            columns["robots"].append(archive.counts[cell])
    if not columns:
        return run_schema("cells").empty_table()
    rows = run.births.take(pa.array(columns.pop("robot"), pa.int64()))
    names = {"birth_island": rows["island"], "birth": rows["birth"]}
    return pa.table({**columns, **names})
