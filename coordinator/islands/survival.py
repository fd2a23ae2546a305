"""Who lives on after a brood off-line, and how large the next one may be.

Where ``selection.culling`` says so, the population varies in size by the survivors'
rule of an arena, with births for a clock. Where a full arena waits for a cull, here
the next birth would never come, so a full population is culled at once.
Source: Hupkes 2016, sections 5.3 and 8.2.
"""

from collections.abc import Sequence

from coordinator.evolution.breeding import Breeder
from coordinator.evolution.culling import select_culled
from coordinator.evolution.selection import Individual
from schema.experiment.document import Culling, Experiment
from schema.robot.ids import BirthId


class SurvivorSelection:
    """Broods come and survivors stay, on one island."""

    def __init__(self, experiment: Experiment, breeder: Breeder) -> None:
        """Have seen no birth.

        Args:
            experiment: the island's.
            breeder: picks the survivors of a population of one size.
        """
        selection = experiment.selection
        self._births, self._children = experiment.births, selection.children
        self._rules = selection.culling
        self._breeder = breeder
        interval = self._rules.interval if self._rules else experiment.births
        self._every = EveryNBirths(interval, selection.population)

    def brood_end(self, births: int, living: int) -> int:
        """Return how many will have been born after the next brood.

        Args:
            births: that have been.
            living: how many there are; no brood takes them beyond the limit, but
                one child is always born.
        """
        end = min(births + self._children, self._births)
        if self._rules is None:
            return end
        return min(end, births + max(1, self._rules.population_limit - living))

    def survivors(
        self,
        parents: Sequence[Individual],
        children: Sequence[Individual],
        last: BirthId,
    ) -> tuple[Individual, ...]:
        """Return the population after a brood whose last birth is ``last``."""
        if self._rules is None:
            return self._breeder.survivors(parents, children, last)
        living = sorted([*parents, *children], key=lambda one: one.birth)
        return tuple(self._fit_enough(living, self._rules, last.number + 1))

    def _fit_enough(
        self, living: list[Individual], rules: Culling, births: int
    ) -> list[Individual]:
        is_due = self._every.is_due_at(births)
        if not is_due and len(living) < rules.population_limit:
            return living
        _, culled = select_culled(living, rules)
        gone = {one.birth for one in culled}
        return [one for one in living if one.birth not in gone]


class EveryNBirths:
    """Comes round once in every interval of births, however they are counted on."""

    def __init__(self, interval: int, start: int) -> None:
        """Count from ``start`` births on."""
        self._interval = interval
        self._next = start + interval

    def is_due_at(self, births: int) -> bool:
        """Return whether the time has come; once for all that has passed by then."""
        if births < self._next:
            return False
        self._next += self._interval * ((births - self._next) // self._interval + 1)
        return True
