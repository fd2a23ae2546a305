"""Jobs that take longer than others of their kind did: who deserves a second try.

Pure: it counts on a clock that it is told and decides nothing about results, for
whoever answers first answers the same.
"""

from coordinator.dispatch.events import JobKind

PATIENCE = 4.0
"""A job is late after so many times the typical duration of its kind."""
LEAST_S = 1.0
"""And never before [s]: a second copy costs more than waiting so long."""
LOOK_S = 0.25
"""Time between two looks for jobs that are late [s]."""
_NEWEST_WEIGHT = 0.1


class Stragglers:
    """How long jobs of each kind take, from when they are given out [s]."""

    def __init__(self) -> None:
        """Know of no job yet."""
        self._typical_s: dict[JobKind, float] = {}
        self._next_look_s = 0.0

    def learn(self, kind: JobKind, duration_s: float) -> None:
        """Note how long a job took."""
        known = self._typical_s.get(kind, duration_s)
        self._typical_s[kind] = known + _NEWEST_WEIGHT * (duration_s - known)

    def is_time(self, now_s: float) -> bool:
        """Return whether to look for late jobs now; if so, not again for a while."""
        if now_s < self._next_look_s:
            return False
        self._next_look_s = now_s + LOOK_S
        return True

    def is_late(self, kind: JobKind, elapsed_s: float) -> bool:
        """Return whether a job that is out is late; never before one came back."""
        typical_s = self._typical_s.get(kind)
        if typical_s is None:
            return False
        return elapsed_s > max(LEAST_S, PATIENCE * typical_s)
