"""Selection: the choice of parents and of survivors, and culling.

A rule of selection, built-in or of a user, gets a population and returns places in it;
``schema.plugins.protocols`` says what. The answer of a rule is checked before it is
used.
Source: Hupkes 2016, sections 5.3 and 8.2; the code of the original.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from math import fsum
from typing import Any, TypeVar

import numpy as np
from msgspec import Struct

from coordinator.evolution.random_streams import BufferedRng
from schema.errors import ExperimentError, shown
from schema.experiment.document import ArenaSection, Culling, SelectionSection
from schema.experiment.selection_rules import own_rule
from schema.plugins.contract import broken
from schema.plugins.origin import naming_plugin
from schema.plugins.protocols import ParentSelection, Selectable, SurvivorSelection

S = TypeVar("S", bound=Selectable)


def fittest_first(individuals: Sequence[S]) -> list[S]:
    """Return individuals by descending fitness; of equals the elder comes first."""
    return sorted(individuals, key=_order)


def _order(one: Selectable) -> tuple[float, object]:
    return -one.fitness, one.birth


@dataclass(frozen=True, slots=True)
class Rule:
    """A rule of selection with its parameters.

    Attributes:
        key: of the experiment, for messages.
        function: the rule.
        parameters: its last argument.
        is_own: of a user, so that its answers are checked.
    """

    key: str
    function: Callable[..., Any]
    parameters: object
    is_own: bool = True

    def places(
        self,
        count: int,
        population: Sequence[Selectable],
        *rest: Any,  # noqa: ANN401 - as the rule needs
    ) -> list[int]:
        """Return the answer of the rule, checked: different places in the population.

        The rule gets a list of its own. It may sort it or remove from it, as rules of
        earlier runs do; what it returns are then places in the changed list.

        Raises:
            ExperimentError: it raises, returns anything else, or puts individuals into
                its list.
        """
        if not self.is_own:
            return list(self.function(population, *rest, self.parameters))
        given = list(population)
        with naming_plugin(self.key, self.function):
            answer = self.function(given, *rest, self.parameters)
            place_of = {id(one): place for place, one in enumerate(population)}
            try:
                left = [place_of.pop(id(one)) for one in given]
            except KeyError:
                raise ExperimentError(
                    "must not replace individuals of the population"
                ) from None
            places = _whole_numbers(answer)
            if not len(places) == len(set(places)) == count or not (
                min(places) >= 0 and max(places) < len(left)
            ):
                highest = len(left) - 1
                rule = f"return {count} different whole numbers from 0 to {highest}"
                raise broken("", rule, came=shown(answer))
            return [left[at] for at in places]


def _whole_numbers(answer: object) -> list[int]:
    """Return the answer of a rule as plain integers; empty if it is none."""
    if not isinstance(answer, (Sequence, np.ndarray)):
        return []
    kinds = set(map(type, answer))
    if kinds <= {int}:
        return list(answer)
    is_whole = all(issubclass(kind, (int, np.integer)) for kind in kinds)
    return [int(at) for at in answer] if is_whole else []


def rule_of(selection: SelectionSection, name: str) -> Rule:
    """Return the rule that selects ``parents`` or ``survivors``.

    That of the parents of ``none`` is never called.

    Raises:
        ExperimentError: as of ``own_rule``.
    """
    key, path = f"selection.{name}", getattr(selection, name)
    if own := own_rule(selection, name):
        return Rule(key, *own)
    if name == "survivors":
        return Rule(key, SURVIVOR_RULES[path], None, is_own=False)
    size = Tournament(selection.tournament_size) if path == "tournament" else None
    rule = random_parents if path == "none" else PARENT_RULES[path]
    return Rule(key, rule, size, is_own=False)


def select_parents(
    population: Sequence[S], rng: np.random.Generator, rule: Rule
) -> tuple[S, S]:
    """Return two different parents, the one that gives its root first.

    The population is in a reproducible order.

    Raises:
        ExperimentError: the rule raises, or returns no two places.
    """
    first, second = rule.places(2, population, rng)
    return population[first], population[second]


def select_survivors(
    parents: Sequence[S],
    children: Sequence[S],
    rng: np.random.Generator,
    selection: SelectionSection,
    rule: Rule,
) -> tuple[S, ...]:
    """Return the next population of constant size, in birth order.

    A brood cut short by the end of the run always competes with its parents, or the
    population would shrink.

    Raises:
        ExperimentError: the rule raises, or returns other than that many places.
    """
    size = selection.population
    pool = list(children)
    if selection.keep_parents or len(pool) < size:
        pool = [*parents, *pool]
    if len(pool) > size:
        pool = [pool[at] for at in rule.places(size, pool, size, rng)]
    return tuple(sorted(pool, key=lambda one: one.birth))


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
    draws = BufferedRng(rng)
    places = list(range(len(population)))

    def order(place: int) -> tuple[float, object]:
        return _order(population[place])

    first = min(draws.sample(places, parameters.size), key=order)
    places.remove(first)
    return first, min(draws.sample(places, parameters.size), key=order)


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
