"""Rules of one arena: those of the thesis, loading, and checks of their decisions.

The thesis's are births on a clock, and death of the weak.

``schema.plugins.arena_rules`` says what rules see and decide.
"""

from collections.abc import Callable, Iterator, Mapping
from itertools import chain
from math import isfinite
from types import MappingProxyType
from typing import Any

import numpy as np
from msgspec import Struct, ValidationError, msgpack
from msgspec.structs import astuple

from coordinator.arena.ecosystem import EcosystemRules
from coordinator.evolution.selection import select_culled
from schema.errors import ExperimentError, shown
from schema.experiment.brains import NoParameters
from schema.experiment.changes import OF_RULES, settings_at, with_value
from schema.experiment.document import Experiment
from schema.plugins.arena_rules import (
    ArenaRules,
    ArenaView,
    Conception,
    Death,
    Decisions,
    Stores,
)
from schema.plugins.contract import broken
from schema.plugins.load import load_object
from schema.plugins.origin import naming_plugin
from schema.plugins.parameters import read_parameters
from schema.robot.ids import BirthId


class _Mature(Struct, frozen=True):
    """Robot that may mate, and may be culled."""

    birth: BirthId
    fitness: float


class ThesisRules:
    """One birth an interval while there is room and two are mature; culls.

    Source: Hupkes 2016, section 5.3.3; the code of the original.
    """

    stores: Stores = MappingProxyType({})
    meeting_distance_m = None

    def __init__(self, experiment: Experiment, _parameters: None) -> None:
        assert experiment.arena is not None
        self._arena = experiment.arena
        self._needed = experiment.selection.parents_needed

    def decide(self, view: ArenaView, _rng: np.random.Generator) -> Decisions:
        """Return the child that is due, and the weak that are culled."""
        mature = [
            _Mature(robot.birth, robot.fitness)
            for robot in view.robots
            if robot.fitness is not None
        ]
        births: tuple[Conception, ...] = ()
        if view.births_are_due and view.room and len(mature) >= self._needed:
            births = (Conception(),)
        deaths: tuple[Death, ...] = ()
        if view.deaths_are_due:
            reason, culled = select_culled(mature, self._arena)
            deaths = tuple(Death(one.birth, reason) for one in culled)
        return Decisions(births, deaths, is_extinct=len(view.robots) < self._needed)


WHERE = "arena.rules"
METHODS = ("decide",)
"""Methods of a class of rules; its other attributes may be those of its objects."""
Make = Callable[[Experiment, Any], ArenaRules]
BUILT_IN: dict[str, Make] = {"thesis": ThesisRules, "ecosystem": EcosystemRules}
"""Rules that come with the toolkit, by short name."""


def load_rules(experiment: Experiment) -> tuple[Make, Any]:
    """Return the class of the rules of an arena, and its parameters.

    Raises:
        ExperimentError: no such class, or other parameters than it declares, also
            those of ``[[changes]]``.
    """
    for change in experiment.changes:
        if change.setting.startswith(OF_RULES):
            for value in change.values:
                parameters_at(with_value(experiment, change.setting, value))
    return parameters_at(experiment)


def parameters_at(experiment: Experiment) -> tuple[Make, Any]:
    """Return the class of the rules and its parameters, without those of changes."""
    arena = experiment.arena
    assert arena is not None
    made = load_object(arena.rules, WHERE, BUILT_IN, METHODS)
    declared = getattr(made, "Parameters", None)
    kind = declared or NoParameters
    read = read_parameters(arena.parameters, kind, "arena.parameters")
    return made, read if declared else None


class CheckedRules:
    """New rules of an arena, whose decisions are checked.

    Attributes:
        stores: names and initial values.
        meeting_distance_m: as of ``ArenaRules``.
    """

    def __init__(self, experiment: Experiment) -> None:
        """Make the object.

        Raises:
            ExperimentError: as of ``load_rules``; the class raises, or one of its
                attributes is of another type.
        """
        self._experiment = experiment
        keys = [change.setting for change in experiment.changes]
        self._may_change = any(key.startswith(OF_RULES) for key in keys)
        self._plugin, parameters = load_rules(experiment)
        with naming_plugin(WHERE, self._plugin):
            self.memory = self._plugin(experiment, parameters)
            self.stores = _converted("stores", self.memory.stores, Stores)
            distance_m = self.memory.meeting_distance_m
            kind = float | None
            self.meeting_distance_m = _converted("meeting_distance_m", distance_m, kind)

    def parameters(self, time_s: float) -> Any:  # noqa: ANN401 - of the class
        """Return the parameters at a simulated time [s]; None if they never change."""
        if not self._may_change:
            return None
        return parameters_at(settings_at(self._experiment, time_s))[1]

    def decide(self, view: ArenaView, rng: np.random.Generator) -> Decisions:
        """Return the decisions of the rules.

        Raises:
            ExperimentError: they raise, or decide what cannot be.
        """
        with naming_plugin(WHERE, self._plugin):
            answer = self.memory.decide(view, rng)
            if not isinstance(answer, Decisions):
                raise broken("decide", "return Decisions", answer)
            decisions: Decisions = _converted("decide", answer, Decisions)
            for problem in _problems(decisions, view, self.stores):
                raise ExperimentError(f"decide: {problem}")
        return decisions


def _converted(what: str, value: Any, kind: Any) -> Any:  # noqa: ANN401 - of the kind
    """Return a value whose types and bounds have been checked."""
    try:
        data = msgpack.encode(value, enc_hook=_plain)
        return msgpack.decode(data, type=kind)
    except (ValidationError, TypeError, AttributeError) as error:
        raise broken(what, f"have the types of its protocol ({error})", value) from None


def _plain(value: Any) -> object:  # noqa: ANN401 - a mapping, or of NumPy
    return dict(value) if isinstance(value, Mapping) else value.item()


def _problems(decisions: Decisions, view: ArenaView, known: Stores) -> Iterator[str]:
    living = {robot.birth for robot in view.robots}
    dying = [death.birth for death in decisions.deaths]
    if len(set(dying)) < len(dying):
        yield f"must name each robot that dies once, got {shown(dying)}"
    parents = [one for child in decisions.births for one in child.parents]
    for one in {*dying, *parents, *decisions.stores} - living:
        yield f"must name living robots, got {shown(one)}"
    for child in decisions.births:
        if len(set(child.parents)) < len(child.parents):
            yield f"must name different parents, got {shown(child.parents)}"
    children = [child.stores for child in decisions.births]
    for stores in (*decisions.stores.values(), *children):
        if unknown := stores.keys() - known.keys():
            yield f"stores: must be of {shown(list(known))}, got {shown(unknown)}"
    places = [child.near or () for child in decisions.births]
    numbers = [each.values() for each in (*decisions.stores.values(), *children)]
    radii = [child.radius_m or 0.0 for child in decisions.births]
    patches = [astuple(patch) for patch in decisions.patches]
    if not all(map(isfinite, chain(*places, radii, *numbers, *patches))):
        yield "places, radii, stores and patches must be finite, got others"
