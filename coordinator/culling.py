"""Who of an arena's mature dies.

Source: Hupkes 2016, section 5.3.3; facts of the original, section 5.2. The weakest
go first (trap B11: the original cut an unsorted list).
"""

from collections.abc import Sequence
from math import fsum
from typing import Literal

from coordinator.selection import Individual, fittest_first
from schema.experiment import Arena

CullReason = Literal["selection", "cull"]


def select_doomed(
    mature: Sequence[Individual], arena: Arena
) -> tuple[CullReason, list[Individual]]:
    """Return who dies and by which rule, the least fit first.

    Args:
        mature: those who were judged over a whole window; no others may die.
        arena: the rules. All go who reach less than a share of the mean fitness
            ("selection"). Where none is that weak and the arena is full of the
            mature, a share of it goes ("cull"). So many always stay.
    """
    weakest = fittest_first(mature)[::-1]
    spare = max(0, len(weakest) - arena.population_floor)
    if not weakest:
        return "selection", []
    mean = fsum(one.fitness for one in weakest) / len(weakest)
    limit = arena.survive_share_of_mean * mean
    below = [one for one in weakest if one.fitness < limit]
    if below:
        return "selection", below[:spare]
    if len(weakest) < arena.population_limit:
        return "selection", []
    count = round(arena.full_cull_share * arena.population_limit)
    return "cull", weakest[: min(count, spare)]
