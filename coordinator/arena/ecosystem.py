"""Ecosystem: robots that meet mate, feed in patches, and die without energy or of age.

No robot is selected centrally. Source: the idea is that of Weel et al. 2014 (robots
reproduce from within); the energy and the patches are our own.
"""

from collections.abc import Mapping
from math import cos, sin, sqrt, tau
from types import MappingProxyType
from typing import Annotated, Literal

import numpy as np
from msgspec import Meta, Struct

from schema.experiment.document import Experiment
from schema.experiment.section import Extent, Length, NotNegative, Positive
from schema.limits import MOST_PATCHES
from schema.plugins.arena_rules import (
    ArenaView,
    Conception,
    Death,
    Decisions,
    Patch,
    Resident,
)
from schema.robot.ids import BirthId

ENERGY, RESTS_UNTIL = "energy", "rests_until_s"
"""Stores of a robot."""
_EMPTY = 0.01
"""Share of its capacity below which a patch is empty."""


class Ecosystem(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Parameters of the rules ``ecosystem``. Energy has a unit of its own.

    Attributes:
        mating_distance_m: distance of two cores within which they meet [m].
        mating_s: two robots mate once they have met for this time, decision by
            decision without a pause [s].
        rest_s: time after a mating before the next one [s].
        maturity_s: age from which a robot mates [s].
        mating_cost: energy that each parent loses at a mating.
        mating_gain: energy that each parent gets at a mating, from nowhere.
        start_energy: of a founder.
        child_energy: of a child; each parent gives half of it.
        energy_per_s: that a robot loses each second.
        energy_per_j: that it loses for each joule of work of its motors.
        lifespan_s: age at which a robot dies [s]; 0 is no such age.
        patches: number of patches with energy.
        patch_radius_m: of each patch [m].
        patch_inflow: energy that grows in each patch each second.
        patch_capacity: most energy of a patch; all begin with it.
        intake_per_s: most energy that a robot takes in a patch each second. If there is
            less, all in the patch get the same share of what they would take.
        patch_spread_m: distance of the patches from the origin, at most [m].
        patch_motion: "fixed"; "circling" at that distance; or "regrowing" at another
            place each time that they are empty.
        patch_period_s: time of one circle [s].
    """

    mating_distance_m: Extent = 0.4
    mating_s: NotNegative = 2.0
    rest_s: NotNegative = 20.0
    maturity_s: NotNegative = 15.0
    mating_cost: NotNegative = 1.0
    mating_gain: NotNegative = 0.0
    start_energy: Positive = 20.0
    child_energy: Positive = 10.0
    energy_per_s: NotNegative = 0.1
    energy_per_j: NotNegative = 2.0
    lifespan_s: NotNegative = 600.0
    patches: Annotated[int, Meta(ge=0, le=MOST_PATCHES)] = 4
    patch_radius_m: Extent = 0.6
    patch_inflow: NotNegative = 0.5
    patch_capacity: Positive = 30.0
    intake_per_s: NotNegative = 0.5
    patch_spread_m: Length = 2.0
    patch_motion: Literal["fixed", "circling", "regrowing"] = "fixed"
    patch_period_s: Positive = 300.0


class EcosystemRules:
    """Rules without a central selection.

    A robot loses energy by living and by moving, and takes energy in patches, whose
    inflow bounds the population. Two robots that stay near each other have a child,
    which takes energy from both.
    """

    Parameters = Ecosystem

    def __init__(self, _experiment: Experiment, parameters: Ecosystem) -> None:
        self.meeting_distance_m = parameters.mating_distance_m
        self.stores = MappingProxyType(
            {ENERGY: parameters.start_energy, RESTS_UNTIL: 0.0}
        )
        self._rules = parameters
        self._patches: list[Patch] = []
        self._met_s: dict[tuple[BirthId, BirthId], float] = {}
        self._couples: list[tuple[BirthId, ...]] = []

    def decide(self, view: ArenaView, rng: np.random.Generator) -> Decisions:
        """Feed the robots, and return who mates and who dies."""
        if view.parameters is not None:
            self._rules = view.parameters
        rules, energy = self._rules, self._balance(view)
        deaths = tuple(
            Death(robot.birth, "age" if energy[robot.birth] > 0.0 else "no energy")
            for robot in view.robots
            if energy[robot.birth] <= 0.0 or 0.0 < rules.lifespan_s <= robot.age_s
        )
        dead = {death.birth for death in deaths}
        living = {
            robot.birth: robot for robot in view.robots if robot.birth not in dead
        }
        births, rests = self._mate(view, living, energy)
        self._place_patches(view.time_s, rng)
        stores = {
            birth: {ENERGY: energy[birth], **rests.get(birth, {})} for birth in living
        }
        return Decisions(births, deaths, stores, tuple(self._patches))

    def _balance(self, view: ArenaView) -> dict[BirthId, float]:
        """Return the energy of each robot, after what it took and lost.

        Parents get back the energy for children that were not born.
        """
        rules = self._rules
        energy = {robot.birth: robot.stores[ENERGY] for robot in view.robots}
        for couple, child in zip(self._couples, view.born, strict=True):
            for birth in couple:
                if child is None and birth in energy:
                    energy[birth] += rules.child_energy / 2
        for birth, taken in self._feed(view).items():
            energy[birth] += taken
        for robot in view.robots:
            lost = rules.energy_per_s * lived_s(robot, view)
            energy[robot.birth] -= lost + rules.energy_per_j * robot.work_j
        return energy

    def _feed(self, view: ArenaView) -> dict[BirthId, float]:
        """Let patches grow, and return what each robot takes from them."""
        rules, taken = self._rules, {robot.birth: 0.0 for robot in view.robots}
        for number, patch in enumerate(self._patches):
            grown = patch.content + rules.patch_inflow * view.interval_s
            content = min(rules.patch_capacity, grown)
            wanted = {
                robot.birth: rules.intake_per_s
                * lived_s(robot, view)
                * share_within(robot, patch)
                for robot in view.robots
            }
            total = sum(wanted.values())
            share = min(1.0, content / total) if total else 0.0
            for birth, energy in wanted.items():
                taken[birth] += share * energy
            content -= share * total
            self._patches[number] = Patch(patch.x, patch.y, patch.radius_m, content)
        return taken

    def _mate(
        self,
        view: ArenaView,
        living: Mapping[BirthId, Resident],
        energy: dict[BirthId, float],
    ) -> tuple[tuple[Conception, ...], dict[BirthId, dict[str, float]]]:
        """Return children, and until when their parents rest; those who met long first.

        Parents pay at once.
        """
        rules, before = self._rules, self._met_s
        met_s = {(one.first, one.second): one.duration_s for one in view.meetings}
        self._met_s = {pair: before.get(pair, 0.0) + met_s[pair] for pair in met_s}
        price = rules.child_energy / 2 + rules.mating_cost
        ready = {
            birth
            for birth, robot in living.items()
            if robot.age_s >= rules.maturity_s
            and robot.stores[RESTS_UNTIL] <= view.time_s
            and energy[birth] > price
        }
        births: list[Conception] = []
        rests: dict[BirthId, dict[str, float]] = {}
        self._couples = []
        for pair in sorted(self._met_s, key=lambda pair: (-self._met_s[pair], pair)):
            if self._met_s[pair] < rules.mating_s or not ready.issuperset(pair):
                continue
            ready.difference_update(pair)
            del self._met_s[pair]
            self._couples.append(pair)
            for birth in pair:
                energy[birth] += rules.mating_gain - price
                rests[birth] = {RESTS_UNTIL: view.time_s + rules.rest_s}
            (ax, ay), (bx, by) = (living[birth].place for birth in pair)
            near = (ax + bx) / 2, (ay + by) / 2
            stores = {ENERGY: rules.child_energy}
            births.append(Conception(pair, near, rules.mating_distance_m, stores))
        return tuple(births), rests

    def _place_patches(self, time_s: float, rng: np.random.Generator) -> None:
        """Move the patches; at first, and where they regrow, to random places."""
        rules, patches = self._rules, self._patches
        for number in range(rules.patches):
            is_new = number == len(patches)
            content = rules.patch_capacity if is_new else patches[number].content
            is_empty = content <= _EMPTY * rules.patch_capacity
            if rules.patch_motion == "circling":
                angle = tau * (number / rules.patches + time_s / rules.patch_period_s)
                radius_m = rules.patch_spread_m
            elif is_new or (is_empty and rules.patch_motion == "regrowing"):
                angle, share = rng.uniform(0.0, tau), rng.uniform()
                radius_m = rules.patch_spread_m * sqrt(share)
            else:
                continue
            x, y = radius_m * cos(angle), radius_m * sin(angle)
            patches[number : number + 1] = [Patch(x, y, rules.patch_radius_m, content)]


def lived_s(robot: Resident, view: ArenaView) -> float:
    """Return how long a robot lived since the last decision [s].

    The first decision is after the last founder's birth.
    """
    return min(robot.age_s, view.interval_s)


def share_within(robot: Resident, patch: Patch) -> float:
    """Return the share of the samples of a robot's track that are within a patch."""
    if not len(robot.track):
        return 0.0
    away = robot.track.astype(np.float64) - (patch.x, patch.y)
    return float(np.mean(np.hypot(away[:, 0], away[:, 1]) <= patch.radius_m))
