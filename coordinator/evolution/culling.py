"""Who dies of an arena's mature, or of an off-line population of varying size.

Source: Hupkes 2016, section 5.3.3; facts of the original, section 5.2. The weakest
go first (trap B11: the original cut an unsorted list).
"""

from collections.abc import Sequence
from math import fsum
from typing import Literal

from coordinator.evolution.selection import Individual, fittest_first
from schema.experiment.document import Arena, Culling

CullReason = Literal["selection", "cull"]


def select_culled(
    mature: Sequence[Individual], rules: Arena | Culling
) -> tuple[CullReason, list[Individual]]:
    """Return who dies and by which rule, the least fit first.

    Args:
        mature: those who were judged over a whole window; no others may die.
        rules: of an arena or an off-line island. All go who reach less than a share
            of the mean fitness ("selection"). Where none is that weak and it is full
            of the mature, a share of its limit goes ("cull"). So many always stay.
    """
    weakest = fittest_first(mature)[::-1]
    spare = max(0, len(weakest) - rules.population_floor)
    if not weakest:
        return "selection", []
    mean = fsum(one.fitness for one in weakest) / len(weakest)
    limit = rules.survive_share_of_mean * mean
    below = [one for one in weakest if one.fitness < limit]
    if below:
        return "selection", below[:spare]
    if len(weakest) < rules.population_limit:
        return "selection", []
    count = round(rules.full_cull_share * rules.population_limit)
    return "cull", weakest[: min(count, spare)]
