"""Novelty search, and dominated novelty search.

Distances and their means are elementwise, in a fixed order: no result depends on
libraries of linear algebra, threads or processors.
"""

from collections.abc import Sequence
from typing import Literal

import numpy as np
from msgspec import Struct

from coordinator.evolution.diversity.ranking import required_grid, sound
from coordinator.evolution.members import Member
from schema.experiment.document import Experiment
from schema.experiment.grid import Grid
from schema.experiment.section import AtLeastOne, NotNegative, Size
from schema.robot.trace import Floats


class NoveltySearch(Struct, frozen=True, kw_only=True):
    """Parameters of ``novelty``.

    Attributes:
        nearest: number of nearest others whose mean distance is the novelty.
        distance: of the ``measures`` of [grid], each as a share of its bounds; or of
            the ``body``, a tree edit distance, which needs the extra ``analysis``.
        every: one of so many births is archived, whatever its novelty.
        threshold: archive instead all whose novelty among their brood and the archive
            is at least this.
        capacity: most individuals in the archive; the first of them leave it.
    """

    nearest: AtLeastOne = 15
    distance: Literal["measures", "body"] = "measures"
    every: AtLeastOne = 10
    threshold: NotNegative | None = None
    capacity: Size = 1000


class Novelty:
    """Ranks by the mean distance to the nearest of the population and an archive.

    Source: Lehman and Stanley 2011; an archive by chance: Gomes et al. 2015.
    """

    Parameters = NoveltySearch

    def __init__(self, parameters: NoveltySearch, experiment: Experiment) -> None:
        in_measures = parameters.distance == "measures"
        self._grid = required_grid(experiment) if in_measures else None
        self._rules = parameters
        self._archive: list[Member] = []

    def ranks(self, population: Sequence[Member]) -> list[float]:
        """Return the novelty of each individual, negative."""
        # A member is equal to itself, whatever its fitness was then.
        others = list(dict.fromkeys([*population, *self._archive]))
        if self._grid is None:
            rows = [one.distances(others) for one in population]
            distances = np.array(rows, np.float64).reshape(len(rows), len(others))
        else:
            distances = _distances(self._grid, population, others)
        np.fill_diagonal(distances, np.inf)
        return [-mean for mean in _means(distances, self._rules.nearest)]

    def update(self, brood: Sequence[Member]) -> None:
        """Archive some of a brood, by their novelty or by the number of their birth."""
        born, rules = sound(brood), self._rules
        if rules.threshold is None:
            new = [one for one in born if one.birth.number % rules.every == 0]
        else:
            ranks = zip(born, self.ranks(born), strict=True)
            new = [one for one, rank in ranks if -rank >= rules.threshold]
        self._archive = [*self._archive, *new][-rules.capacity :]

    def archive(self, _population: Sequence[Member]) -> dict[str, Member]:
        """Return the archive."""
        return {one.birth.name: one for one in self._archive}


class Competition(Struct, frozen=True, kw_only=True):
    """Parameters of ``dominated-novelty``.

    Attributes:
        nearest: number of nearest fitter ones whose mean distance counts.
    """

    nearest: AtLeastOne = 3


class DominatedNovelty:
    """Ranks by the mean distance to the nearest fitter ones, in measures.

    An individual without a fitter one ranks first.
    Source: Bahlous-Boldi et al. 2025, Dominated Novelty Search.
    """

    Parameters = Competition

    def __init__(self, parameters: Competition, experiment: Experiment) -> None:
        self._nearest = parameters.nearest
        self._grid = required_grid(experiment)

    def ranks(self, population: Sequence[Member]) -> list[float]:
        """Return the mean distance of each individual, negative."""
        fitness = np.array([one.fitness for one in population])
        distances = _distances(self._grid, population, population)
        distances[fitness <= fitness[:, None]] = np.inf
        return [-mean for mean in _means(distances, self._nearest)]

    def archive(self, population: Sequence[Member]) -> dict[str, Member]:
        """Return the population, which is its archive."""
        return {one.birth.name: one for one in sound(population)}


def _distances(grid: Grid, some: Sequence[Member], others: Sequence[Member]) -> Floats:
    """Return the distances of individuals in measures, as shares of bounds, (N, M)."""
    squares = np.zeros((len(some), len(others)))
    for name, (low, high) in zip(grid.measures, grid.bounds, strict=True):
        values = np.array([one.measures[name] for one in some])
        to = np.array([one.measures[name] for one in others])
        squares += ((values[:, None] - to) / (high - low)) ** 2
    return np.sqrt(squares)


def _means(distances: Floats, count: int) -> list[float]:
    """Return the mean of the least finite distances of each row, infinite without."""
    nearest = np.sort(distances, axis=1)[:, :count]
    total, counts = np.zeros(len(distances)), np.isfinite(nearest).sum(axis=1)
    for column in np.where(np.isfinite(nearest), nearest, 0.0).T:
        total += column
    means = np.where(counts, total / np.maximum(counts, 1), np.inf)
    return [float(mean) for mean in means]
