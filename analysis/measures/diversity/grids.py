"""Cells of a grid that births have reached: archives, scores, novelty."""

import math
from collections import Counter

import numpy as np
import pyarrow as pa

from analysis.measures.diversity.objectives import added_volume, front
from analysis.measures.diversity.samples import numbers
from analysis.measures.outputs import run_schema
from analysis.measures.population_table import Numbers
from analysis.measures.run_tables import RunTables
from schema.experiment.grid import Cell, Grid, cell_name, cell_of

NEAREST = 5
"""Earlier births whose mean distance is the novelty of a birth."""
_MOST_OBJECTIVES = 3
"""Objectives up to which a hypervolume is computed: it takes long with more."""
_SCORES = ("coverage", "qd_score", "archive_entropy", "hypervolume")


class Archive:
    """The fittest of each cell, of all robots that were added; of equals the elder.

    Source: Mouret and Clune 2015, "Illuminating search spaces by mapping elites"; the
    archive of pyribs, without a learning rate.

    Attributes:
        elites: index and fitness of the fittest robot of each cell.
        counts: number of robots of each cell.
    """

    def __init__(self, grid: Grid) -> None:
        self._grid = grid
        self._is_minimised = np.isin(grid.measures, grid.minimised)
        self.elites: dict[Cell, tuple[int, float]] = {}
        self.counts: Counter[Cell] = Counter()
        self._front: Numbers = np.empty((0, 1 + len(grid.measures)))
        self._qd_score = self._logs = self._volume = 0.0

    def add(self, index: int, fitness: float, values: Numbers) -> None:
        """Add a robot with its measures, (M,)."""
        grid = self._grid
        cell = cell_of(grid, dict(zip(grid.measures, values.tolist(), strict=True)))
        self.counts[cell] += 1
        count = self.counts[cell]
        self._logs += count * math.log(count) - (count - 1) * math.log(count - 1 or 1)
        _, before = self.elites.get(cell, (0, grid.offset))
        if cell not in self.elites or fitness > before:
            self._qd_score += fitness - before
            self.elites[cell] = index, fitness
        if self._front.shape[1] <= _MOST_OBJECTIVES and fitness > grid.offset:
            share = shares(grid, values)
            worth = np.where(self._is_minimised, 1.0 - share, share)
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
        share = len(self.elites) / math.prod(self._grid.bins)
        return share, self._qd_score, max(0.0, entropy), volume


def shares(grid: Grid, values: Numbers) -> Numbers:
    """Return measures, (..., M), as shares of their ranges, 0 to 1."""
    low, high = np.array(grid.bounds).T
    within: Numbers = np.clip((values - low) / (high - low), 0.0, 1.0)
    return within


def grid_measures(run: RunTables) -> dict[str, Numbers]:
    """Return the measures of populations that need a grid, (G,) each.

    They are empty without a grid, and without a robot that has its measures.
    """
    grid, born = run.grid, run.samples
    if grid is None or not born.num_rows:
        return {}
    table = run.population_table
    columns = {name: np.full(len(table), np.nan) for name in (*_SCORES, "novelty")}
    for island in np.unique(table.islands).tolist():
        mine = born.filter(pa.compute.field("island") == island)
        groups = np.flatnonzero(table.islands == island)
        ends = np.searchsorted(mine["births"], table.births[groups], side="right")
        values = numbers(mine, grid.measures)
        scores: list[tuple[float, ...]] = []
        _filled(grid, mine, scores)
        for name, course in zip(_SCORES, np.array(scores).T, strict=True):
            columns[name][groups] = course[ends]
        novelties = novelty(shares(grid, values))
        for group, start, end in zip(groups, [0, *ends[:-1]], ends, strict=True):
            if end > max(start, 1):
                columns["novelty"][group] = np.nanmean(novelties[start:end])
    return columns


def _filled(grid: Grid, born: pa.Table, scores: list[tuple[float, ...]]) -> Archive:
    """Return the archive of all robots; add its scores before and after each."""
    archive, values = Archive(grid), numbers(born, grid.measures)
    scores.append(archive.scores)
    for index, fitness in enumerate(born["fitness"].to_pylist()):
        archive.add(index, fitness, values[index])
        scores.append(archive.scores)
    return archive


def novelty(places: Numbers) -> Numbers:
    """Return the mean distance of places, (N, M), to the nearest earlier ones, (N,).

    NaN of the first.

    Source: Lehman and Stanley 2011, "Abandoning objectives", with an archive of all.
    """
    found = np.full(len(places), np.nan)
    for at in range(1, len(places)):
        distances = np.sqrt(((places[:at] - places[at]) ** 2).sum(axis=1))
        nearest = min(NEAREST, at)
        found[at] = np.partition(distances, nearest - 1)[:nearest].mean()
    return found


def cells(run: RunTables) -> pa.Table:
    """Return the fittest robot of each cell that the births of an island reached."""
    grid, born, rows = run.grid, run.samples, []
    assert grid is not None
    for island in pa.compute.unique(born["island"]).to_pylist():
        mine = born.filter(pa.compute.field("island") == island)
        archive = _filled(grid, mine, [])
        for cell, (index, fitness) in sorted(archive.elites.items()):
            birth = run.births["birth"][mine["robot"][index].as_py()].as_py()
            so_far, robots = mine["births"][index].as_py(), archive.counts[cell]
            rows.append(
                (island, cell_name(cell), island, birth, fitness, so_far, robots)
            )
    schema = run_schema("cells")
    named = [dict(zip(schema.names, row, strict=True)) for row in rows]
    return pa.Table.from_pylist(named, schema)
