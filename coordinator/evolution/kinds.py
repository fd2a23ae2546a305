"""Kinds of plug-ins that the coordinator runs: selection, encoding, brain, learner."""

from collections.abc import Callable, Iterator, Mapping
from functools import partial
from operator import attrgetter
from typing import Any, NamedTuple

from msgspec.structs import replace

from coordinator.evolution.brains import BUILT_IN as BRAINS
from coordinator.evolution.check_encoding import check_encoding
from coordinator.evolution.check_rule import Labels, check_rule
from coordinator.evolution.encodings import BUILT_IN as ENCODINGS
from coordinator.evolution.encodings import METHODS, WHERE
from coordinator.evolution.learners.learner import BUILT_IN as LEARNERS
from coordinator.evolution.learners.learner import METHODS as LEARNER_METHODS
from coordinator.evolution.learners.learner import WHERE as LEARNER
from coordinator.evolution.learners.learner import check_learner
from coordinator.evolution.rules import RULE_CLASSES, rule_of
from coordinator.evolution.selection import PARENT_RULES, SURVIVOR_RULES
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
from schema.plugins.load import load_object


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
