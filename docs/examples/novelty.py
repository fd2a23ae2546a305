"""Novelty search with an archive: individuals with new bodies mate and live on."""

import numpy as np
from msgspec import Struct

import revolve as rv


class Novelty:
    """Draws individuals in proportion to their novelty (Lehman and Stanley 2011)."""

    class Parameters(Struct):
        """Number of nearest bodies that count, and least novelty in the archive."""

        nearest: int = 5
        archived: float = 5.0

    def __init__(self, parameters: Parameters) -> None:
        self.parameters = parameters
        self.known: list[rv.Selectable] = []

    def select(
        self, population: list[rv.Selectable], count: int, rng: np.random.Generator
    ) -> list[int]:
        """Return places; the archive stays as it is."""
        chances = np.array(self.novelty(population)) + 1e-6
        return list(rng.choice(len(chances), count, False, chances / chances.sum()))

    def update(self, brood: list[rv.Selectable]) -> None:
        """Archive the novel individuals of a brood."""
        novelty = dict(zip(brood, self.novelty(brood), strict=True))
        self.known += [e for e in brood if novelty[e] >= self.parameters.archived]

    def archive(self, _population: list[rv.Selectable]) -> dict[str, rv.Selectable]:
        """Return the archive for the table of that name, by entry."""
        return {e.birth.name: e for e in self.known}

    def novelty(self, some: list[rv.Selectable]) -> list[float]:
        """Return the mean distance to the nearest others, the first is to itself."""
        others = list({e.birth: e for e in [*some, *self.known]}.values())
        nearest = slice(1, 1 + self.parameters.nearest)
        return [float(np.sort(e.distances(others))[nearest].mean()) for e in some]
