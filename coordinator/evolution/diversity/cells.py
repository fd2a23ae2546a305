"""MAP-Elites: the fittest of each cell of a grid, and parents by curiosity."""

from collections.abc import Sequence

from coordinator.evolution.diversity.ranking import required_grid, sound
from coordinator.evolution.members import Member
from coordinator.evolution.selection import fittest_first
from schema.experiment.document import Experiment
from schema.experiment.grid import Cell, Grid, cell_name, cell_of
from schema.robot.ids import BirthId

_ENTERED, _REJECTED = 1.0, -0.5
"""What a parent's curiosity gets for a child (Cully and Demiris 2018)."""


def elites(grid: Grid, individuals: Sequence[Member]) -> dict[Cell, Member]:
    """Return the fittest of each cell, by cell; of equals the elder."""
    best: dict[Cell, tuple[float, BirthId, Member]] = {}
    for one in sound(individuals):
        cell, own = cell_of(grid, one.measures), (-one.fitness, one.birth, one)
        best[cell] = min(best.get(cell, own), own)
    return {cell: best[cell][-1] for cell in sorted(best)}


class MapElites:
    """Ranks the elites of all cells first: the population is the archive.

    While there are too few to choose parents, the fittest others survive, too.
    Source: Mouret and Clune 2015.
    """

    varies = True

    def __init__(self, _parameters: object, experiment: Experiment) -> None:
        self._grid = required_grid(experiment)

    def ranks(self, population: Sequence[Member]) -> list[int]:
        """Return 0 for the elites; for others more, the fitter the less."""
        kept = set(elites(self._grid, population).values())
        others = fittest_first([one for one in population if one not in kept])
        rank_of = {one: 1 + rank for rank, one in enumerate(others)}
        return [rank_of.get(one, 0) for one in population]

    def archive(self, population: Sequence[Member]) -> dict[str, Member]:
        """Return the elites, by the names of their cells."""
        found = elites(self._grid, population)
        return {cell_name(cell): one for cell, one in found.items()}


class Curiosity:
    """Ranks parents by what became of their children.

    A child counts by whether it was an elite after its brood, among all that were born
    on the island; immigrants do not matter.
    Source: Cully and Demiris 2018, with tournaments in place of proportions.
    """

    def __init__(self, _parameters: object, experiment: Experiment) -> None:
        self._grid = required_grid(experiment)
        self._elites: dict[Cell, Member] = {}
        self._scores: dict[BirthId, float] = {}

    def ranks(self, population: Sequence[Member]) -> list[float]:
        """Return the curiosity of each individual, negative."""
        return [-self._scores.get(one.birth, 0.0) for one in population]

    def update(self, brood: Sequence[Member]) -> None:
        """Score the parents of a brood."""
        self._elites = elites(self._grid, [*self._elites.values(), *brood])
        entered = set(self._elites.values())
        for child in brood:
            gain = _ENTERED if child in entered else _REJECTED
            for parent in child.parents:
                self._scores[parent] = self._scores.get(parent, 0.0) + gain
