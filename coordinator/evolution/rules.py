"""Rules of selection of one island: loading, memory, and checks of their answers.

A rule, built-in or of a user, gets a population and returns places in it;
``schema.plugins.protocols`` says what. A rule that is a class has a memory, which only
``update`` changes: couples are selected when verdicts arrive, in any order.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from coordinator.evolution.diversity.cells import Curiosity, MapElites
from coordinator.evolution.diversity.fronts import AgeLayered, Nsga2
from coordinator.evolution.diversity.novelty import DominatedNovelty, Novelty
from coordinator.evolution.diversity.ranking import RankSelection
from coordinator.evolution.members import Member, Relatives
from coordinator.evolution.selection import (
    PARENT_RULES,
    SURVIVOR_RULES,
    S,
    Tournament,
    random_parents,
)
from schema.errors import ExperimentError, naming, shown
from schema.experiment.brains import NoParameters
from schema.experiment.document import Experiment, SelectionSection
from schema.experiment.selection_rules import own_rule, rule_key
from schema.plugins.contract import broken
from schema.plugins.origin import naming_plugin
from schema.plugins.parameters import read_parameters

RULE_CLASSES: dict[str, type[Any]] = {
    "curiosity": Curiosity,
    "map-elites": MapElites,
    "dominated-novelty": DominatedNovelty,
    "novelty": Novelty,
    "nsga2": Nsga2,
    "age-layered": AgeLayered,
}
"""Built-in rankings; they get the experiment beside their parameters."""
Select = Callable[[Any, int, np.random.Generator], Any]
"""Gets a population, a number and a stream; returns as many places."""


@dataclass(frozen=True, slots=True)
class Rule:
    """A rule of selection of one island.

    Attributes:
        key: of the experiment, for messages.
        plugin: function or class, for messages.
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
            most, number = (len(left), "at least ") if self.varies else (count, "")
            if not count <= len(set(places)) == len(places) <= most or not (
                min(places) >= 0 and max(places) < len(left)
            ):
                number = f"{number}{count} different whole numbers"
                rule = f"return {number} from 0 to {len(left) - 1}"
                raise broken("", rule, came=shown(answer))
            return [left[at] for at in places]

    @property
    def varies(self) -> bool:
        """It selects at least the number that it is given."""
        return getattr(self.plugin, "varies", False) is True

    def archive(self, population: Sequence[S]) -> dict[str, S] | None:
        """Return the archive of the rule by entry; None if it has none.

        Raises:
            ExperimentError: it raises, or returns anything else.
        """
        method = getattr(self.memory, "archive", None)
        if self.relatives is None or not callable(method):
            return None
        with naming_plugin(self.key, self.plugin):
            archive = dict(method(self.relatives.members(population)))
            kinds = {(type(entry), type(one)) for entry, one in archive.items()}
            if kinds - {(str, Member)}:
                raise broken("archive", "return individuals by texts", archive)
            return archive

    def update(self, brood: Sequence[S]) -> None:
        """Change the memory of the rule, if it has one."""
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


def rule_of(experiment: Experiment, name: str, relatives: Relatives) -> Rule:
    """Return a new rule of an island for ``parents``, ``survivors`` or ``emigrants``.

    That of the parents of ``none`` is never called. Built-in emigrants have no rule.

    Raises:
        ExperimentError: as of ``own_rule``, its class raises, or a built-in one lacks
            a section or gets wrong parameters.
    """
    key = rule_key(name)
    section: Any = getattr(experiment, key.partition(".")[0])
    named = getattr(section, name)
    if kind := RULE_CLASSES.get(named):
        ranking = _ranking(kind, experiment, name)
        return Rule(key, kind, ranking.select, relatives, ranking)
    if own := own_rule(section, name):
        plugin, parameters = own
        if not isinstance(plugin, type):
            call = _with_parameters(name, plugin, parameters)
            return Rule(key, plugin, call, relatives)
        with naming_plugin(key, plugin):
            memory = plugin(parameters)
        return Rule(key, plugin, memory.select, relatives, memory)
    rules: Mapping[str, Any] = SURVIVOR_RULES if name == "survivors" else PARENT_RULES
    rule = rules.get(named, random_parents)
    # The only parameters that any of them reads.
    size = Tournament(section.tournament_size)
    return Rule(key, rule, _with_parameters(name, rule, size))


def check_rules(experiment: Experiment) -> None:
    """Raise ``ExperimentError`` if built-in rules of an island lack what they need."""
    for name in ("parents", "survivors"):
        if kind := RULE_CLASSES.get(getattr(experiment.selection, name)):
            _ranking(kind, experiment, name)


def _ranking(kind: type[Any], experiment: Experiment, name: str) -> RankSelection:
    key, section = rule_key(name), experiment.selection
    table = getattr(section, f"{name}_parameters")
    declared = getattr(kind, "Parameters", NoParameters)
    parameters = read_parameters(table, declared, f"{key}_parameters")
    size = section.tournament_size if name == "parents" else None
    with naming(key):
        return RankSelection(kind(parameters, experiment), size)


def _with_parameters(
    name: str, function: Callable[..., Any], parameters: object
) -> Select:
    """Return a function that selects as its class would."""
    if name == "parents":
        return lambda population, _, rng: function(population, rng, parameters)
    return lambda population, count, rng: function(population, count, rng, parameters)


def select_survivors(
    parents: Sequence[S],
    children: Sequence[S],
    rng: np.random.Generator,
    selection: SelectionSection,
    rule: Rule,
) -> tuple[S, ...]:
    """Return the next population, in birth order.

    Its size is constant, or as a rule that ``varies`` likes. A brood cut short by the
    end of the run always competes with its parents, or the population would shrink.
    """
    size = max(1, selection.parents_needed) if rule.varies else selection.population
    pool = list(children)
    if selection.keep_parents or len(pool) < size:
        pool = [*parents, *pool]
    if rule.varies or len(pool) > size:
        pool = [pool[at] for at in rule.places(size, pool, rng)]
    return tuple(sorted(pool, key=lambda one: one.birth))
