"""Rules of the neutral control: as many births and deaths at the same times, by lot."""

from types import MappingProxyType

import numpy as np

from coordinator.arena.ecosystem import (
    ENERGY,
    RESTS_UNTIL,
    Ecosystem,
    EcosystemRules,
)
from schema.experiment.document import Experiment
from schema.plugins.arena_rules import (
    ArenaView,
    Conception,
    Death,
    Decisions,
    Resident,
)
from schema.robot.ids import BirthId


class Neutral(Ecosystem, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Parameters: those of the twin, and the times of its births and deaths.

    Attributes:
        births_s: times of the births of children [s].
        deaths_s: times of the deaths [s].
    """

    births_s: tuple[float, ...]
    deaths_s: tuple[float, ...]


class NeutralRules(EcosystemRules):
    """An ecosystem in which energy and meetings are counted but decide nothing.

    Parents are two robots drawn from those of maturity, or from all if those are less
    than two; the child is born near the first. The dead are drawn from all. Robots
    whose physics diverges, and children that come to nothing, are made good later.
    """

    Parameters = Neutral  # type: ignore[assignment]
    # The protocol asks for them in the class; each object has its own.
    stores = MappingProxyType[str, float]({})
    meeting_distance_m = 0.0

    def __init__(self, experiment: Experiment, parameters: Neutral) -> None:
        super().__init__(experiment, parameters)
        self._twin = parameters
        self._children = 0

    def decide(self, view: ArenaView, rng: np.random.Generator) -> Decisions:
        """Feed the robots as the twin does; draw who mates and who dies."""
        rules, energy = self._twin, self._balance(view)
        self._children += sum(child is not None for child in view.born)
        gone = view.births - len(view.robots)
        due = sum(time_s <= view.time_s for time_s in rules.deaths_s) - gone
        count = min(max(due, 0), len(view.robots))
        drawn = rng.choice(len(view.robots), count, replace=False).tolist()
        deaths = tuple(Death(view.robots[number].birth, "lot") for number in drawn)
        dead = {death.birth for death in deaths}
        living = [robot for robot in view.robots if robot.birth not in dead]
        births = self._pair(view, living, energy, rng)
        self._place_patches(view.time_s, rng)
        stores = {robot.birth: {ENERGY: energy[robot.birth]} for robot in living}
        return Decisions(births, deaths, stores, tuple(self._patches))

    def _pair(
        self,
        view: ArenaView,
        living: list[Resident],
        energy: dict[BirthId, float],
        rng: np.random.Generator,
    ) -> tuple[Conception, ...]:
        rules, births = self._twin, []
        due = sum(time_s <= view.time_s for time_s in rules.births_s) - self._children
        grown = [robot for robot in living if robot.age_s >= rules.maturity_s]
        several = grown if len(grown) > 1 else living
        self._couples = []
        for _ in range(max(due, 0) if len(several) > 1 else 0):
            first, second = rng.choice(len(several), 2, replace=False).tolist()
            pair = (several[first].birth, several[second].birth)
            self._couples.append(pair)
            for birth in pair:
                price = rules.child_energy / 2 + rules.mating_cost
                energy[birth] += rules.mating_gain - price
            stores = {ENERGY: rules.child_energy, RESTS_UNTIL: 0.0}
            near = several[first].place
            births.append(Conception(pair, near, rules.mating_distance_m, stores))
        return tuple(births)
