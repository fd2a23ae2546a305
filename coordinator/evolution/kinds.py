"""Kinds of plug-ins that the coordinator runs: selection, encoding, brain, learner.

A rule of selection is checked before the first birth, on small populations. It must
depend on its arguments alone or, if it is a class, on the broods that ``update`` took,
too: an archive in a module is shared by all islands of a process.
"""

from collections import defaultdict
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import partial
from operator import attrgetter
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np
from msgspec.structs import replace

from coordinator.evolution.brains import BUILT_IN as BRAINS
from coordinator.evolution.breeding import Individual, failed_last
from coordinator.evolution.check_encoding import check_encoding
from coordinator.evolution.encodings import BUILT_IN as ENCODINGS
from coordinator.evolution.encodings import METHODS, WHERE, IslandEncoding, encoding_of
from coordinator.evolution.learners.learner import BUILT_IN as LEARNERS
from coordinator.evolution.learners.learner import METHODS as LEARNER_METHODS
from coordinator.evolution.learners.learner import WHERE as LEARNER
from coordinator.evolution.learners.learner import check_learner
from coordinator.evolution.members import Relatives
from coordinator.evolution.rules import RULE_CLASSES, Rule, rule_of
from coordinator.evolution.selection import PARENT_RULES, SURVIVOR_RULES
from schema.errors import ExperimentError
from schema.experiment.check import check_experiment
from schema.experiment.document import (
    BrainSection,
    EncodingSection,
    Experiment,
    SelectionSection,
    island_experiments,
)
from schema.experiment.kinds import Kind, is_class, sections_of, takes
from schema.experiment.learning import Learning
from schema.experiment.migration import Migration
from schema.experiment.selection_rules import METHODS as RULE_METHODS
from schema.experiment.selection_rules import NAMES, own_rule, rule_key
from schema.plugins.contract import broken, repeated
from schema.plugins.load import load_object
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
    """Return populations: small, of equals, varied, in part without fitness."""

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


class _Ruled(NamedTuple):
    """Settings of an island with a rule, and the measures that it may ask for."""

    island: Experiment
    labels: Labels


def _selection_kind(name: str, functions: Mapping[str, object], arguments: int) -> Kind:
    key = rule_key(name)
    part = key.partition(".")[0]
    of_key = attrgetter(key)
    classes = {at: rule for at, rule in RULE_CLASSES.items() if at in NAMES[name]}
    empty = Migration() if name == "emigrants" else SelectionSection()

    def rules(whole: Experiment) -> Iterator[_Ruled]:
        for at in island_experiments(whole):
            if getattr(at, part) is not None and ":" in of_key(at):
                # Islands that differ in nothing else are checked once.
                names = ("space", "generation", "brain", "encoding", part)
                meant = {name: getattr(at, name) for name in names}
                yield _Ruled(Experiment("rules", **meant), at.measures.labels)

    def load(ruled: _Ruled) -> object:
        own = own_rule(getattr(ruled.island, part), name)
        return own and own[0]

    def by_hand(path: str) -> _Ruled:
        section: Any = replace(empty, **{name: path})
        return _Ruled(Experiment("by hand", **{part: section}), None)

    return Kind(
        name,
        key,
        {**functions, **classes},
        is_one=lambda plugin: (
            takes(arguments, plugin) or is_class(RULE_METHODS, plugin)
        ),
        section=by_hand,
        sections=rules,
        path=lambda ruled: str(of_key(ruled.island)),
        load=load,
        check=lambda ruled: check_rule(partial(rule_of, ruled.island, name), *ruled),
    )


class _Encoded(NamedTuple):
    """An experiment, and that of an island, whose encoding is meant."""

    whole: Experiment
    island: Experiment


def _load_encoding(encoded: _Encoded) -> object:
    # What is wrong elsewhere is not the fault of this plug-in.
    check_experiment(encoded.whole, encoded.whole.name)
    return load_object(encoded.island.encoding.type, WHERE, ENCODINGS, METHODS)


def _by_hand(path: str) -> _Encoded:
    experiment = Experiment("by hand", encoding=EncodingSection(type=path))
    return _Encoded(experiment, experiment)


def brain_kind(check: Callable[[Experiment], None]) -> Kind:
    """Return the kind of brain types.

    The check is that of both halves of a brain type; one of them runs in workers.
    """
    return Kind(
        "brain",
        "brain.type",
        BRAINS,
        is_one=partial(is_class, ("outputs", "grow", "pack", "bank")),
        section=lambda path: Experiment("by hand", brain=BrainSection(type=path)),
        sections=lambda experiment: [experiment],
        path=lambda experiment: experiment.brain.type,
        load=lambda experiment: load_object(
            experiment.brain.type, "brain.type", BRAINS
        ),
        check=check,
    )


ENCODING = Kind(
    "encoding",
    WHERE,
    ENCODINGS,
    is_one=partial(is_class, METHODS),
    section=_by_hand,
    sections=lambda whole: [_Encoded(whole, at) for at in island_experiments(whole)],
    path=lambda encoded: encoded.island.encoding.type,
    load=_load_encoding,
    check=lambda encoded: check_encoding(encoded.island),
)
KINDS = (
    ENCODING,
    _selection_kind("parents", PARENT_RULES, 3),
    _selection_kind("survivors", SURVIVOR_RULES, 4),
    _selection_kind("emigrants", {}, 4),
    Kind(
        "learner",
        LEARNER,
        LEARNERS,
        is_one=partial(is_class, LEARNER_METHODS),
        section=lambda path: Learning(learner=path),
        sections=lambda experiment: sections_of(experiment, "learning"),
        path=lambda rules: rules.learner,
        load=lambda rules: load_object(
            rules.learner, LEARNER, LEARNERS, LEARNER_METHODS
        ),
        check=check_learner,
    ),
)
