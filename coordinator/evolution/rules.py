"""Rules of selection: the built-in ones and those of users, called alike.

A rule gets a population and returns places in it; ``schema.plugins.protocols`` says
what. The answer of a rule is checked before it is used.
Source of the built-in rules: Hupkes 2016, section 5.3.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from msgspec import Struct

from coordinator.evolution.random_streams import BufferedRng
from coordinator.evolution.selection import Couple, Individual
from schema.errors import ExperimentError, shown
from schema.experiment.document import Selection
from schema.experiment.selection_rules import own_rule
from schema.plugins.origin import raised_by, where_defined
from schema.plugins.protocols import ParentSelection, Selectable, SurvivorSelection


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
    order = [(-one.fitness, one.birth) for one in population]
    places = list(range(len(population)))
    first = min(draws.sample(places, parameters.size), key=order.__getitem__)
    places.remove(first)
    return first, min(draws.sample(places, parameters.size), key=order.__getitem__)


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
    return sorted(places, key=lambda at: _fittest_first(population[at]))[:count]


def random_survivors(
    population: Sequence[Selectable],
    count: int,
    rng: np.random.Generator,
    _parameters: None,
) -> Sequence[int]:
    """Return uniformly drawn survivors."""
    return BufferedRng(rng).sample(range(len(population)), count)


def _fittest_first(one: Selectable) -> tuple[float, object]:
    return -one.fitness, one.birth


PARENTS: dict[str, ParentSelection] = {
    "tournament": tournament,
    "random": random_parents,
}
"""Built-in selections of parents; ``none`` selects no parents."""
SURVIVORS: dict[str, SurvivorSelection] = {"best": best, "random": random_survivors}
"""Built-in selections of survivors."""


@dataclass(frozen=True, slots=True)
class Rule:
    """A rule of selection with its parameters.

    Attributes:
        key: of the experiment, for messages.
        function: the rule.
        parameters: its last argument.
    """

    key: str
    function: Callable[..., Any]
    parameters: object

    def places(
        self,
        count: int,
        population: Sequence[Selectable],
        *rest: Any,  # noqa: ANN401 - as the rule needs
    ) -> list[int]:
        """Return the answer of the rule, checked: different places in the population.

        Args:
            count: number of places that it must return.
            population: the candidates.
            rest: further arguments, without the parameters.

        Raises:
            ExperimentError: it raises, or returns anything else.
        """
        try:
            answer = self.function(population, *rest, self.parameters)
        except Exception as error:
            what = raised_by(self.function, error)
            raise ExperimentError(f"{self.key}: {what}") from error
        places = _whole_numbers(answer)
        if len(places) == len(set(places)) == count and (
            min(places) >= 0 and max(places) < len(population)
        ):
            return places
        raise ExperimentError(
            f"{self.key}: {where_defined(self.function)}: must return {count} "
            f"different whole numbers from 0 to {len(population) - 1}, got "
            f"{shown(answer)}"
        )


def _whole_numbers(answer: object) -> list[int]:
    """Return the answer of a rule as plain integers; empty if it is none."""
    if not isinstance(answer, (list, tuple, np.ndarray)):
        return []
    kinds = set(map(type, answer))
    if kinds <= {int}:
        return list(answer)
    is_whole = all(issubclass(kind, (int, np.integer)) for kind in kinds)
    return [int(at) for at in answer] if is_whole else []


def parents_rule(selection: Selection) -> Rule:
    """Return the rule that selects parents; that of ``none`` is never called.

    Raises:
        ExperimentError: as of ``own_rule``.
    """
    found = own_rule(selection, "parents")
    if found is None:
        name = selection.parents
        size = Tournament(selection.tournament_size)
        found = (
            PARENTS.get(name, random_parents),
            size if name == "tournament" else None,
        )
    return Rule("selection.parents", *found)


def survivors_rule(selection: Selection) -> Rule:
    """Return the rule that selects survivors.

    Raises:
        ExperimentError: as of ``own_rule``.
    """
    found = own_rule(selection, "survivors")
    return Rule(
        "selection.survivors", *(found or (SURVIVORS[selection.survivors], None))
    )


def select_parents(
    population: Sequence[Individual], rng: np.random.Generator, rule: Rule
) -> Couple:
    """Return two different parents, the one that gives its root first.

    Args:
        population: the candidates, in a reproducible order.
        rng: source of all choices.
        rule: of ``parents_rule``.

    Raises:
        ExperimentError: the rule raises, or returns no two places.
    """
    first, second = rule.places(2, population, rng)
    return population[first], population[second]


def select_survivors(
    parents: Sequence[Individual],
    children: Sequence[Individual],
    rng: np.random.Generator,
    selection: Selection,
    rule: Rule,
) -> tuple[Individual, ...]:
    """Return the next population of constant size, in birth order.

    Args:
        parents: the population before.
        children: the brood.
        rng: source of all choices.
        selection: size of the population; whether parents compete with their children.
            A brood cut short by the end of the run always competes with its parents,
            or the population would shrink.
        rule: of ``survivors_rule``.

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
