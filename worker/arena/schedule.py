"""At which physics steps of an arena something is done besides physics."""

from schema.experiment.settings import ArenaSettings

LOOKS_PER_PARTING = 25
"""Clusters are looked at for parts that drifted apart every so many looks."""


class Schedule:
    """The steps of ticks, samples, looks and partings, from the arena's settings.

    Attributes:
        tick_steps: between two ticks of the brains.
    """

    def __init__(self, settings: ArenaSettings) -> None:
        """Take the intervals of an arena."""
        clock, look_steps = settings.simulation, settings.arena.proximity_steps
        self.tick_steps = clock.brain_steps
        self._sample_steps, self._look_steps = clock.pose_steps, look_steps
        self._parting_steps = LOOKS_PER_PARTING * look_steps

    def is_tick(self, step: int) -> bool:
        """Whether brains tick then."""
        return step % self.tick_steps == 0

    def is_sample(self, step: int) -> bool:
        """Whether positions are sampled then."""
        return step % self._sample_steps == 0

    def is_look(self, step: int) -> bool:
        """Whether it is looked then who may touch whom."""
        return step % self._look_steps == 0

    def is_parting(self, step: int) -> bool:
        """Whether clusters may fall apart then; a look, too."""
        return step % self._parting_steps == 0

    def next_tick(self, step: int) -> int:
        """Return when brains tick next after a step."""
        return _next(step, self.tick_steps)

    def moments(self, step: int, until: int) -> tuple[int, ...]:
        """Return the steps after one at which anything is done, ascending.

        The last is one beyond which nobody can be stepped before the others: a
        tick, a parting or ``until``.
        """
        end = min(until, self.next_tick(step), _next(step, self._parting_steps))
        found = {end}
        for interval in (self._sample_steps, self._look_steps):
            found.update(range(_next(step, interval), end, interval))
        return tuple(sorted(found))


def _next(step: int, interval: int) -> int:
    return step - step % interval + interval
