"""A selection of parents and a selection of survivors."""

from collections.abc import Sequence

import msgspec
import numpy as np

import revolve as rv


def alike(
    population: Sequence[rv.Selectable], rng: np.random.Generator, parameters: None
) -> tuple[int, int]:
    """Return a random parent, and the fittest of those nearest to its size."""
    first = int(rng.integers(len(population)))
    size = population[first].size
    others = [place for place in range(len(population)) if place != first]
    second = min(
        others,
        key=lambda at: (abs(population[at].size - size), -population[at].fitness),
    )
    return first, second


class Elite(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """The table ``[selection.survivors_parameters]``."""

    share: float = 0.5


def elite_and_young(
    population: Sequence[rv.Selectable],
    count: int,
    rng: np.random.Generator,
    parameters: Elite,
) -> list[int]:
    """Return a share of the fittest, and the youngest of the others."""
    by_fitness = sorted(range(len(population)), key=lambda at: -population[at].fitness)
    elite = by_fitness[: round(parameters.share * count)]
    others = [place for place in range(len(population)) if place not in elite]
    return elite + others[len(others) - (count - len(elite)) :]
