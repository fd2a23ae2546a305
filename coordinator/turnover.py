"""Who lives on in an off-line population that varies in size.

The survivors' rule of an arena, with births for a clock: where an arena waits for
room, here the next birth would never come, so a full population is culled at once.
Source: Hupkes 2016, sections 5.3.3 and 8.2.
"""

from collections.abc import Sequence

from coordinator.culling import select_doomed
from coordinator.rhythm import Rhythm
from coordinator.selection import Individual
from schema.experiment import Culling


class Turnover:
    """One island's survivors by ``selection.culling``."""

    def __init__(self, rules: Culling, founders: int) -> None:
        """Count the births after so many founders."""
        self._rules = rules
        self._rhythm = Rhythm(rules.interval, founders)

    def survivors(self, living: Sequence[Individual], births: int) -> list[Individual]:
        """Return who lives on, in birth order.

        Args:
            living: parents and children; all of them have been judged.
            births: how many have been.
        """
        is_due = self._rhythm.comes_round(births)
        ordered = sorted(living, key=lambda one: one.birth)
        if not is_due and len(ordered) < self._rules.population_limit:
            return ordered
        _, doomed = select_doomed(ordered, self._rules)
        gone = {one.birth for one in doomed}
        return [one for one in ordered if one.birth not in gone]

    def room(self, living: int) -> int:
        """Return how many may be born before the next look at who lives on."""
        return max(1, self._rules.population_limit - living)
