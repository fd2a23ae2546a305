"""Selection by a rank of individuals: survivors by truncation, parents by tournaments.

A ranking is a rule of selection that has ``ranks`` in place of ``select``: it gets a
population, in which no evaluation has failed, and returns a rank of each, less is
better. ``update`` and ``archive`` are those of ``StatefulSelection``; it may lack them.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np

from coordinator.evolution.members import Member
from coordinator.evolution.selection import winners
from schema.errors import ExperimentError
from schema.experiment.document import Experiment
from schema.experiment.grid import Grid


class _Last:
    """The population that was ranked last, and its ranks.

    ``check_rule`` refuses attributes that ``select`` changes. It sees an object of this
    class as what it prints: the cache changes no result.
    """

    population: list[Any] | None = None
    ranks: Sequence[Any] = ()


class RankSelection:
    """Selection of the best, or by tournaments: ranked once for all its children."""

    def __init__(self, ranking: Any, tournament_size: int | None) -> None:  # noqa: ANN401 - a ranking
        self._ranking = ranking
        self._tournament_size = tournament_size
        self._last = _Last()
        self.archive = getattr(ranking, "archive", None)

    def select(
        self, population: Sequence[Member], count: int, rng: np.random.Generator
    ) -> Sequence[int]:
        """Return the places of the best, or of the winners of two tournaments.

        Failed individuals are last. Of equals the elder is better; in a tournament
        the one that was drawn first. If the ranking varies, all of the least rank are
        selected.
        """
        size, places = self._tournament_size, range(len(population))
        if size is not None:
            known = [(one.birth, one.known_fitness, one.measures) for one in population]
            if known != self._last.population:
                self._last.ranks = self._ranks(population)
                self._last.population = known
            return winners(len(places), self._last.ranks.__getitem__, size, rng)
        ranks = self._ranks(population)
        order = sorted(places, key=lambda at: (ranks[at], population[at].birth))
        if hasattr(self._ranking, "varies"):
            count = max(count, ranks.count((False, 0)))
        return order[:count]

    def _ranks(self, population: Sequence[Member]) -> Sequence[tuple[bool, Any]]:
        ranks, last = iter(self._ranking.ranks(sound(population))), (True, 0)
        return [last if one.has_failed else (False, next(ranks)) for one in population]

    def update(self, brood: Sequence[Member]) -> None:
        """Let the ranking change its memory."""
        self._last.population = None
        if hasattr(self._ranking, "update"):
            self._ranking.update(brood)


def sound(individuals: Sequence[Member]) -> list[Member]:
    """Return the individuals whose evaluation has not failed."""
    return [one for one in individuals if not one.has_failed]


def required_grid(experiment: Experiment) -> Grid:
    """Return the grid of an experiment; raise ``ExperimentError`` without one."""
    if experiment.grid is None:
        raise ExperimentError("needs the section [grid], which names measures")
    return experiment.grid
