"""Built-in rules of selection, of parents and of survivors, and culling.

Source: Hupkes 2016, sections 5.3 and 8.2; the code of the original.
"""

from collections.abc import Callable, Sequence
from math import fsum
from typing import Any, Protocol, TypeVar

import numpy as np
from msgspec import Struct

from coordinator.evolution.random_streams import BufferedRng
from schema.experiment.document import ArenaSection, Culling
from schema.plugins.protocols import ParentSelection, Selectable, SurvivorSelection
from schema.robot.ids import BirthId


class _Judged(Protocol):
    """What built-in rules need of an individual."""

    @property
    def birth(self) -> BirthId: ...
    @property
    def fitness(self) -> float: ...


S = TypeVar("S", bound=_Judged)


def fittest_first(individuals: Sequence[S]) -> list[S]:
    """Return individuals by descending fitness; of equals the elder comes first."""
    return sorted(individuals, key=_order)


def _order(one: _Judged) -> tuple[float, object]:
    return -one.fitness, one.birth


class Tournament(Struct, frozen=True):
    """Parameters of ``tournament``.

    Attributes:
        size: number of candidates of each tournament.
    """

    size: int = 4


def tournament(
    population: Sequence[Selectable], rng: np.random.Generator, parameters: Tournament
) -> tuple[int, int]:
    """Return the winners of two tournaments.

    Each parent is the fittest of a few drawn without replacement, the second from the
    rest of the population. Of equals the elder wins.
    """
    return winners(
        len(population), lambda at: _order(population[at]), parameters.size, rng
    )


def winners(
    count: int, order: Callable[[int], Any], size: int, rng: np.random.Generator
) -> tuple[int, int]:
    """Return the places of the winners of two tournaments, those of least order.

    The second is drawn from the rest of the ``count`` places.
    """
    draws = BufferedRng(rng)
    places = list(range(count))
    first = min(draws.sample(places, size), key=order)
    places.remove(first)
    return first, min(draws.sample(places, size), key=order)


def random_parents(
    population: Sequence[Selectable], rng: np.random.Generator, _parameters: None
) -> tuple[int, int]:
    """Return two uniformly drawn parents."""
    first, second = BufferedRng(rng).sample(range(len(population)), 2)
    return first, second


def best(
    population: Sequence[Selectable],
    count: int,
    _rng: np.random.Generator,
    _parameters: None,
) -> Sequence[int]:
    """Return the fittest; of equals the elder survives."""
    places = range(len(population))
    return sorted(places, key=lambda at: _order(population[at]))[:count]


def random_survivors(
    population: Sequence[Selectable],
    count: int,
    rng: np.random.Generator,
    _parameters: None,
) -> Sequence[int]:
    """Return uniformly drawn survivors."""
    return BufferedRng(rng).sample(range(len(population)), count)


PARENT_RULES: dict[str, ParentSelection] = {
    "tournament": tournament,
    "random": random_parents,
}
"""Built-in selections of parents; ``none`` selects no parents."""
SURVIVOR_RULES: dict[str, SurvivorSelection] = {
    "best": best,
    "random": random_survivors,
}
"""Built-in selections of survivors."""


def cull_population(
    parents: Sequence[S], children: Sequence[S], founders: int, rules: Culling
) -> tuple[S, ...]:
    """Return the next population of varying size, in birth order.

    The rule is that of an arena, with births as its clock. A full arena waits for its
    next cull; a full off-line population is culled at once, or no brood would follow.
    The first interval begins after the founders.
    """
    living = sorted([*parents, *children], key=lambda one: one.birth)
    births = children[-1].birth.number + 1 - founders
    before = max(0, births - len(children))
    is_due = births // rules.interval > before // rules.interval
    if not is_due and len(living) < rules.population_limit:
        return tuple(living)
    _, culled = select_culled(living, rules)
    return tuple(one for one in living if one not in culled)


def select_culled(
    mature: Sequence[S], rules: ArenaSection | Culling
) -> tuple[str, list[S]]:
    """Return the robots to cull and the reason, the least fit first.

    Robots below a share of the mean fitness are culled ("selection"). The limit is as
    far below a negative mean as it would be below a positive one. If there are
    none, and the mature alone reach the population limit, a share of the limit is
    culled ("cull"). At least ``population_floor`` of the mature remain. The original
    did not sort the list first.
    """
    weakest = fittest_first(mature)[::-1]
    spare = max(0, len(weakest) - rules.population_floor)
    if not weakest:
        return "selection", []
    mean = fsum(one.fitness for one in weakest) / len(weakest)
    share = rules.survive_share_of_mean
    limit = mean - (1.0 - share) * abs(mean) if mean < 0.0 else share * mean
    below = [one for one in weakest if one.fitness < limit]
    if below or len(weakest) < rules.population_limit:
        return "selection", below[:spare]
    count = round(rules.full_cull_share * rules.population_limit)
    return "cull", weakest[: min(count, spare)]
