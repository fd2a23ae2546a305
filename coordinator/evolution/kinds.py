"""Kinds of plug-ins that the coordinator runs: selection, encoding, brain, learner."""

import inspect
from collections import defaultdict
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from functools import partial
from types import MappingProxyType

import numpy as np

from coordinator.evolution.brains import BUILT_IN as BRAINS
from coordinator.evolution.breeding import NO_MEASURES
from coordinator.evolution.check_encoding import check_encoding
from coordinator.evolution.encodings import BUILT_IN as ENCODINGS
from coordinator.evolution.encodings import METHODS, WHERE
from coordinator.evolution.learners.check_learner import check_learner
from coordinator.evolution.learners.learner import BUILT_IN as LEARNERS
from coordinator.evolution.learners.learner import METHODS as LEARNER_METHODS
from coordinator.evolution.learners.learner import WHERE as LEARNER
from coordinator.evolution.selection import (
    PARENTS,
    SURVIVORS,
    Rule,
    parents_rule,
    survivors_rule,
)
from schema.errors import ExperimentError
from schema.experiment.check import check_experiment
from schema.experiment.document import (
    BrainSection,
    Encoding,
    Experiment,
    Selection,
    island_experiments,
)
from schema.experiment.kinds import Kind, Use
from schema.experiment.learning import Learning
from schema.plugins.load import load_object
from schema.plugins.origin import where_defined
from schema.robot.ids import BirthId
from schema.robot.results import failed_fitness

Labels = tuple[str, ...] | None
"""Measures that an experiment records; None: every one that a rule may ask for."""

_CHILDREN = 15
_FAILED = 4
"""One of so many robots of a population has failed."""
_RULES = {"parents": parents_rule, "survivors": survivors_rule}
_ASKED: Mapping[str, tuple[int, int, tuple[int, ...]]] = {
    "selection.parents": (2, 2, ()),
    "selection.survivors": (_CHILDREN + 1, _CHILDREN, (_CHILDREN,)),
}
"""Least size of a population for a rule, number of places, and further arguments."""


@dataclass(frozen=True, slots=True)
class _Example:
    """An individual of a check."""

    birth: BirthId
    parents: tuple[BirthId, ...]
    fitness: float
    size: int
    rank: int
    measures: Mapping[str, float] = field(hash=False)


def _example(number: int, fitness: float, labels: Labels) -> _Example:
    parents = (BirthId(0, number // 2), BirthId(0, number // 3)) if number else ()
    measures: Mapping[str, float] = defaultdict(lambda: number / 7)
    if labels is not None:
        measures = dict.fromkeys(labels, number / 7)
    size, rank = 3 + number % 5, 1 + number // 4
    seen = MappingProxyType(measures)
    return _Example(BirthId(0, number), parents, fitness, size, rank, seen)


def _populations(least: int, labels: Labels) -> Iterator[list[_Example]]:
    """Yield populations: small, of equals, varied, in part without fitness."""
    for count, fitness in (
        (least, float),
        (30, lambda _: 0.0),
        (30, lambda number: (number * 7 % 30) / 10),
        (30, lambda number: float(number) if number % 3 else -1.0),
    ):
        yield [_example(number, fitness(number), labels) for number in range(count)]


def check_rule(rule: Rule, labels: Labels = None) -> None:
    """Raise unless a rule of selection keeps its contract on simple populations.

    Args:
        rule: of parents or survivors.
        labels: measures of the individuals.

    Raises:
        ExperimentError: it raises, returns other than as many different places as it
            must, or different ones for the same population and stream.
    """
    least, count, rest = _ASKED[rule.key]
    for population in _populations(least, labels):
        first, second = (
            rule.places(count, population, *rest, np.random.default_rng(1))
            for _ in range(2)
        )
        if first != second:
            raise ExperimentError(
                f"{rule.key}: {where_defined(rule.function)}: must return the same for "
                f"the same population and rng, got {first} and {second}"
            )


def _advise(rule: Rule) -> str:
    """Return what a rule raises for a population with failed robots, or nothing.

    It is not an error: a run in which no robot fails goes on.
    """
    least, count, rest = _ASKED[rule.key]
    *_, population = _populations(least, None)
    failed = failed_fitness(one.fitness for one in population)
    mixed = [
        replace(one, fitness=failed, measures=NO_MEASURES)
        if number % _FAILED == 0
        else one
        for number, one in enumerate(population)
    ]
    try:
        rule.places(count, mixed, *rest, np.random.default_rng(1))
    except ExperimentError as error:
        why = str(error).removeprefix(f"{rule.key}: {where_defined(rule.function)}: ")
        return f"of a population with failed robots (fitness 0, no measures): {why}"
    return ""


def _use(name: str, selection: Selection, labels: Labels) -> Use:
    """Return the use of an own rule of a section; ``name`` as of ``own_rule``."""
    rule = partial(_RULES[name], selection)
    return Use(
        f"selection.{name}",
        getattr(selection, name),
        lambda: rule().function,
        lambda _: check_rule(rule(), labels),
        lambda _: _advise(rule()),
    )


def _used(name: str, experiment: Experiment) -> Iterator[Use]:
    sections = (experiment.selection, *(each.selection for each in experiment.islands))
    for selection in dict.fromkeys(filter(None, sections)):
        if ":" in getattr(selection, name):
            yield _use(name, selection, experiment.measures.labels)


def _takes(arguments: int, plugin: object) -> bool:
    if not inspect.isfunction(plugin):
        return False
    try:
        inspect.signature(plugin).bind(*range(arguments))
    except TypeError:
        return False
    return True


def _has(methods: Iterable[str], plugin: object) -> bool:
    """Return whether an object is a class with some methods."""
    return isinstance(plugin, type) and all(hasattr(plugin, name) for name in methods)


def _encoding(experiment: Experiment, own: Experiment) -> Use:
    """Return the use of an encoding by an island whose experiment is ``own``."""
    path = own.encoding.type
    return Use(
        WHERE,
        path,
        lambda: load_object(path, WHERE, ENCODINGS, METHODS),
        lambda _: check_encoding(own),
        # What is wrong elsewhere is not the fault of this plug-in.
        check_rest=lambda: check_experiment(experiment, experiment.name),
    )


def _encoding_by_hand(path: str) -> Use:
    experiment = Experiment("by hand", encoding=Encoding(type=path))
    return _encoding(experiment, experiment)


def _encodings(experiment: Experiment) -> Iterator[Use]:
    for own in dict.fromkeys(island_experiments(experiment)):
        yield _encoding(experiment, own)


def brain_kind(
    check: Callable[[Experiment], None], check_new: Callable[[Experiment], None]
) -> Kind:
    """Return the kind of brain types.

    Args:
        check: of both halves of the brain type of an experiment; one of them runs in
            workers.
        check_new: of what only new runs must keep.
    """

    def use(experiment: Experiment) -> Use:
        path, key = experiment.brain.type, "brain.type"
        return Use(
            key,
            path,
            lambda: load_object(path, key, BRAINS),
            lambda _: check(experiment),
            check_new=lambda _: check_new(experiment),
        )

    return Kind(
        "brain",
        BRAINS,
        partial(_has, ("outputs", "grow", "pack", "bank")),
        lambda path: use(Experiment("by hand", brain=BrainSection(type=path))),
        lambda experiment: [use(experiment)],
    )


def _learner(rules: Learning) -> Use:
    def load() -> object:
        return load_object(rules.learner, LEARNER, LEARNERS, LEARNER_METHODS)

    return Use(LEARNER, rules.learner, load, lambda _: check_learner(rules))


def _learners(experiment: Experiment) -> Iterator[Use]:
    sections = [experiment.learning, *(each.learning for each in experiment.islands)]
    for rules in dict.fromkeys(filter(None, sections)):
        yield _learner(rules)


ENCODING = Kind(
    "encoding",
    ENCODINGS,
    partial(_has, METHODS),
    _encoding_by_hand,
    _encodings,
)
KINDS = (
    ENCODING,
    Kind(
        "parents",
        PARENTS,
        partial(_takes, 3),
        lambda path: _use("parents", Selection(parents=path), None),
        partial(_used, "parents"),
    ),
    Kind(
        "survivors",
        SURVIVORS,
        partial(_takes, 4),
        lambda path: _use("survivors", Selection(survivors=path), None),
        partial(_used, "survivors"),
    ),
    Kind(
        "learner",
        LEARNERS,
        partial(_has, LEARNER_METHODS),
        lambda path: _learner(Learning(learner=path)),
        _learners,
    ),
)
