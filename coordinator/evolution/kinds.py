"""Kinds of plug-ins that the coordinator runs: selection, encoding, brain, learner."""

from collections import defaultdict
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import partial
from types import MappingProxyType
from typing import NamedTuple

import numpy as np
from msgspec.structs import replace as replace_struct

from coordinator.evolution.brains import BUILT_IN as BRAINS
from coordinator.evolution.breeding import Individual, failed_last
from coordinator.evolution.check_encoding import check_encoding
from coordinator.evolution.encodings import BUILT_IN as ENCODINGS
from coordinator.evolution.encodings import METHODS, WHERE
from coordinator.evolution.learners.check_learner import check_learner
from coordinator.evolution.learners.learner import BUILT_IN as LEARNERS
from coordinator.evolution.learners.learner import METHODS as LEARNER_METHODS
from coordinator.evolution.learners.learner import WHERE as LEARNER
from coordinator.evolution.selection import PARENT_RULES, SURVIVOR_RULES, Rule, rule_of
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
from schema.plugins.contract import repeated
from schema.plugins.load import load_object
from schema.plugins.origin import where_defined
from schema.robot.ids import BirthId

Labels = tuple[str, ...] | None
"""Measures that an experiment records; None: every one that a rule may ask for."""

_CHILDREN = 15
_FAILED = 4
"""One of so many robots of a population has failed."""
_ASKED: Mapping[str, tuple[int, int, tuple[int, ...]]] = {
    "selection.parents": (2, 2, ()),
    "selection.survivors": (_CHILDREN + 1, _CHILDREN, (_CHILDREN,)),
}
"""Least size of a population for a rule, number of places, and further arguments."""


def _example(number: int, fitness: float, labels: Labels) -> Individual:
    parents = (BirthId(0, number // 2), BirthId(0, number // 3)) if number else ()
    measures: Mapping[str, float] = defaultdict(lambda: number / 7)
    if labels is not None:
        measures = dict.fromkeys(labels, number / 7)
    return Individual(
        BirthId(0, number),
        genome=None,
        fitness=fitness,
        rank=1 + number // 4,
        generation=0,
        parents=parents,
        size=3 + number % 5,
        measures=MappingProxyType(measures),
    )


def _populations(least: int, labels: Labels) -> Iterator[list[Individual]]:
    """Yield populations: small, of equals, varied, in part without fitness."""
    for count, fitness in (
        (least, float),
        (30, lambda _: 0.0),
        (30, lambda number: (number * 7 % 30) / 10),
        (30, lambda number: float(number) if number % 3 else -1.0),
    ):
        yield [_example(number, fitness(number), labels) for number in range(count)]


def check_rule(rule: Rule, labels: Labels = None) -> str:
    """Raise unless a rule of selection keeps its contract on simple populations.

    Returns:
        A warning: what it raises for a population with failed robots, which is no
        error, as a run in which no robot fails goes on; or an empty text.

    Raises:
        ExperimentError: it raises, returns other than as many different places as it
            must, or different ones for the same population and stream.
    """
    least, count, rest = _ASKED[rule.key]

    def places(population: Sequence[Individual]) -> list[int]:
        return rule.places(count, population, *rest, np.random.default_rng(1))

    population: list[Individual] = []
    for population in _populations(least, labels):
        repeated("", partial(places, population))
    mixed = [
        individual if number % _FAILED else individual.evaluated(None, ())
        for number, individual in enumerate(population)
    ]
    try:
        places(failed_last(mixed))
    except ExperimentError as error:
        why = str(error).removeprefix(f"{rule.key}: {where_defined(rule.function)}: ")
        return f"of a population with failed robots (fitness 0, no measures): {why}"
    return ""


class _Ruled(NamedTuple):
    """A section of selection, and the measures that the experiment records."""

    selection: SelectionSection
    labels: Labels


def _rules(name: str, experiment: Experiment) -> Iterator[_Ruled]:
    for selection in sections_of(experiment, "selection"):
        if ":" in getattr(selection, name):
            yield _Ruled(selection, experiment.measures.labels)


def _selection_kind(name: str, built_in: Mapping[str, object], arguments: int) -> Kind:
    return Kind(
        name,
        f"selection.{name}",
        built_in,
        is_one=partial(takes, arguments),
        section=lambda path: _Ruled(
            replace_struct(SelectionSection(), **{name: path}), None
        ),
        sections=partial(_rules, name),
        path=lambda ruled: str(getattr(ruled.selection, name)),
        load=lambda ruled: rule_of(ruled.selection, name).function,
        check=lambda ruled: check_rule(rule_of(ruled.selection, name), ruled.labels),
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
