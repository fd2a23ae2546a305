"""Rules of selection of one island: loading, memory, and checks of their answers.

A rule, built-in or of a user, gets a population and returns places in it;
``schema.plugins.protocols`` says what. A rule that is a class has a memory, which only
``update`` changes: couples are selected when verdicts arrive, in any order.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from coordinator.evolution.members import Relatives
from coordinator.evolution.selection import (
    PARENT_RULES,
    SURVIVOR_RULES,
    S,
    Tournament,
    random_parents,
)
from schema.errors import ExperimentError, shown
from schema.experiment.document import SelectionSection
from schema.experiment.selection_rules import RuleSection, own_rule, rule_key
from schema.plugins.contract import broken
from schema.plugins.origin import naming_plugin

Select = Callable[[Any, int, np.random.Generator], Any]
"""Gets a population, a number and a stream; returns as many places."""


@dataclass(frozen=True, slots=True)
class Rule:
    """A rule of selection of one island.

    Attributes:
        key: of the experiment, for messages.
        plugin: function or class, for messages.
        call: selects.
        relatives: of the island; None for a built-in rule, whose answers are not
            checked.
        memory: object of a rule that is a class.
    """

    key: str
    plugin: Callable[..., Any]
    call: Select
    relatives: Relatives | None = None
    memory: Any = None

    def places(
        self, count: int, population: Sequence[S], rng: np.random.Generator
    ) -> list[int]:
        """Return the answer of the rule, checked: different places in the population.

        The rule gets a list of its own. It may sort it or remove from it, as rules of
        earlier runs do; what it returns are then places in the changed list.

        Raises:
            ExperimentError: it raises, returns anything else, or puts individuals into
                its list.
        """
        if self.relatives is None:
            return list(self.call(population, count, rng))
        members = self.relatives.members(population)
        given = list(members)
        with naming_plugin(self.key, self.plugin):
            answer = self.call(given, count, rng)
            place_of = {id(one): place for place, one in enumerate(members)}
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

    def update(self, brood: Sequence[S]) -> None:
        """Change the memory of the rule, if it has one.

        Raises:
            ExperimentError: it raises.
        """
        if self.memory is not None and self.relatives is not None:
            with naming_plugin(self.key, self.plugin):
                self.memory.update(self.relatives.members(brood))


def _whole_numbers(answer: object) -> list[int]:
    """Return the answer of a rule as plain integers; empty if it is none."""
    if not isinstance(answer, (Sequence, np.ndarray)):
        return []
    kinds = set(map(type, answer))
    if kinds <= {int}:
        return list(answer)
    is_whole = all(issubclass(kind, (int, np.integer)) for kind in kinds)
    return [int(at) for at in answer] if is_whole else []


def rule_of(section: RuleSection, name: str, relatives: Relatives) -> Rule:
    """Return a new rule that selects ``parents``, ``survivors`` or ``emigrants``.

    That of the parents of ``none`` is never called. Built-in emigrants have no rule.

    Raises:
        ExperimentError: as of ``own_rule``, or its class raises.
    """
    key = rule_key(name)
    if own := own_rule(section, name):
        plugin, parameters = own
        if not isinstance(plugin, type):
            call = _with_parameters(name, plugin, parameters)
            return Rule(key, plugin, call, relatives)
        with naming_plugin(key, plugin):
            memory = plugin(parameters)
        return Rule(key, plugin, memory.select, relatives, memory)
    assert isinstance(section, SelectionSection)
    rules: Mapping[str, Any] = SURVIVOR_RULES if name == "survivors" else PARENT_RULES
    rule = rules.get(getattr(section, name), random_parents)
    # The only parameters that any of them reads.
    size = Tournament(section.tournament_size)
    return Rule(key, rule, _with_parameters(name, rule, size))


def _with_parameters(
    name: str, function: Callable[..., Any], parameters: object
) -> Select:
    """Return a function that selects as its class would."""
    if name == "parents":
        return lambda population, _, rng: function(population, rng, parameters)
    return lambda population, count, rng: function(population, count, rng, parameters)


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
        pool = [pool[at] for at in rule.places(size, pool, rng)]
    return tuple(sorted(pool, key=lambda one: one.birth))
