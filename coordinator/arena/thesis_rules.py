"""Rules of the thesis: births on a clock, and death of the weak."""

from types import MappingProxyType

import numpy as np
from msgspec import Struct

from coordinator.evolution.selection import select_culled
from schema.experiment.document import Experiment
from schema.plugins.arena_rules import (
    ArenaView,
    Conception,
    Death,
    Decisions,
    Stores,
)
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
