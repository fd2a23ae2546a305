"""Check of a rule of selection before the first birth, on small populations.

The rule must depend on its arguments alone or, if it is a class, on the broods that
``update`` took, too: an archive in a module is shared by all islands of a process.
"""

from collections import defaultdict
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from types import MappingProxyType

import numpy as np
from msgspec.structs import replace

from coordinator.evolution.breeding import Individual, failed_last
from coordinator.evolution.encodings import IslandEncoding, encoding_of
from coordinator.evolution.members import Relatives
from coordinator.evolution.rules import Rule
from schema.errors import ExperimentError
from schema.experiment.document import Experiment
from schema.plugins.contract import broken, repeated
from schema.plugins.origin import where_defined
from schema.plugins.state import own_modules, unchanged
from schema.robot.ids import BirthId

Labels = tuple[str, ...] | None
"""Measures that an experiment records; None: every one that a rule may ask for."""

_IN_UPDATE = "keep its memory in self, as islands share modules and classes"
_IN_SELECT = "not write in select, as update alone changes the memory"
_IN_FUNCTION = "keep nothing from one call to the next (a class may, in update)"
_CHILDREN, _MOST = 15, 30
"""Sizes of broods, and of populations."""
_BROODS = 2
_FAILED = 4
"""One of so many robots of a population has failed."""
_ASKED = {
    "selection.parents": (2, 2),
    "selection.survivors": (_CHILDREN + 1, _CHILDREN),
    "migration.emigrants": (2, 1),
}
"""Least size of a population for a rule, and number of places, if that is fixed."""


def _examples(encoding: IslandEncoding, labels: Labels) -> list[Individual]:
    """Return individuals with random robots and without fitness."""
    examples: list[Individual] = []
    for number in range(_MOST):
        birth = BirthId(0, number)
        genome = encoding.random(np.random.default_rng(number), birth)
        measures: Mapping[str, float] = defaultdict(partial(float, number / 7))
        if labels is not None:
            measures = dict.fromkeys(labels, number / 7)
        data = encoding.to_bytes(genome)
        one = Individual(birth, data, 0.0, rank=1 + number // 4, generation=0)
        size = len(encoding.develop(genome).parts)
        examples.append(replace(one, size=size, measures=MappingProxyType(measures)))
    return examples


def _populations(
    least: int, examples: Sequence[Individual], island: int
) -> list[list[Individual]]:
    def born(one: Individual, fitness: float) -> Individual:
        number = one.birth.number
        parents = (BirthId(island, number // 2), BirthId(island, number // 3))
        birth = BirthId(island, number)
        return replace(
            one, birth=birth, fitness=fitness, parents=parents if number else ()
        )

    step = 7 + 4 * island
    return [
        [born(one, fitness(one.birth.number)) for one in examples[:count]]
        for count, fitness in (
            (least, float),
            (_MOST, lambda _: 0.0),
            (_MOST, lambda number: (number * step % _MOST) / 10),
            (_MOST, lambda number: float(number) if number % 3 else -1.0),
        )
    ]


def _live(
    rules: Mapping[int, Rule],
    examples: Sequence[Individual],
    asked: tuple[int, int],
    modules: Sequence[str],
    *,
    is_backward: bool = False,
) -> dict[int, dict[tuple[int, int], list[int]]]:
    """Return what rules of islands that take turns select, by brood and population.

    ``asked``: least size of a population, and number of places. Modules and, in
    ``select``, objects must not change.
    """
    least, count = asked
    samples = {island: _populations(least, examples, island) for island in rules}
    answers: dict[int, dict[tuple[int, int], list[int]]] = {at: {} for at in rules}
    for brood in range(_BROODS):
        for island, rule in rules.items():
            with unchanged(_IN_UPDATE, modules):
                children = slice(brood * _CHILDREN, (brood + 1) * _CHILDREN)
                rule.update(samples[island][2][children])
        numbers = range(len(samples[min(rules)]))
        for number in reversed(numbers) if is_backward else numbers:
            for island, rule in rules.items():
                places = partial(_places, rule, count, samples[island][number], brood)
                must = _IN_FUNCTION if rule.memory is None else _IN_SELECT
                with unchanged(must, modules, rule.memory):
                    places()
                    rule.archive(samples[island][number])
                answers[island][brood, number] = repeated("", places)
    return answers


def _places(
    rule: Rule, count: int, population: Sequence[Individual], seed: int
) -> list[int]:
    return rule.places(count, population, np.random.default_rng(seed))


def check_rule(
    make: Callable[[Relatives], Rule], experiment: Experiment, labels: Labels = None
) -> str:
    """Raise unless a rule of selection keeps its contract on simple populations.

    Two islands are alone, then take turns; one of them selects in another order, too.
    Robots are random ones of an island's settings. ``make`` returns a new rule.

    Returns:
        A warning: what it raises for a population with failed robots, which is no
        error, as a run in which no robot fails goes on; or an empty text.

    Raises:
        ExperimentError: it raises, returns other than as many different places as it
            must, or different ones for the same population, stream and memory; or it
            changes a module, or its object in ``select``.
    """
    encoding = encoding_of(experiment)
    examples = _examples(encoding, labels)
    new = partial(make, Relatives(encoding.robot_of))
    last = new()  # imports its module
    least, count = _ASKED[last.key]
    if last.varies:
        count = max(1, experiment.selection.parents_needed)
    live = partial(
        _live, examples=examples, asked=(least, count), modules=own_modules()
    )
    alone = {**live({0: new()}), **live({1: new()})}
    if live({0: new(), 1: new()}) != alone:
        must = "select on an island as if there were no other"
        raise broken("", must, came="other places when two islands take turns")
    if live({0: new()}, is_backward=True)[0] != alone[0]:
        must = "select the same whatever was selected before"
        raise broken("", must, came="other places in another order")
    population = _populations(least, examples, 0)[-1]
    failed = failed_last(
        individual if number % _FAILED else individual.evaluated(None, ())
        for number, individual in enumerate(population)
    )
    try:
        last.update(failed)
        _places(last, count, failed, 1)
    except ExperimentError as error:
        why = str(error).removeprefix(f"{last.key}: {where_defined(last.plugin)}: ")
        return f"of a population with failed robots (fitness 0, no measures): {why}"
    return ""
