"""Deadlines of jobs, from what such jobs took so far."""

from collections.abc import Hashable

NEWEST_WEIGHT = 0.1
"""Weight of the newest value in a moving average."""
PATIENCE = 4.0
"""A job is late after this multiple of the typical duration of its kind."""
FIRST_S = 60.0
"""Deadline of a job without history [s]."""
LOOK_S = 0.25
"""Interval between checks for late jobs [s]."""
_MOST_DOUBLINGS = 16


class Deadlines:
    """Typical duration of the jobs of each kind, from their assignment [s]."""

    def __init__(self, least_s: float) -> None:
        """Initialise without history; no deadline is shorter than ``least_s`` [s]."""
        self._least_s = least_s
        self._typical_s: dict[Hashable, float] = {}

    def learn(self, kind: Hashable, duration_s: float) -> None:
        """Note the duration of a job."""
        known = self._typical_s.get(kind, duration_s)
        self._typical_s[kind] = known + NEWEST_WEIGHT * (duration_s - known)

    def forget(self, kind: Hashable) -> None:
        """Drop the history of a kind of jobs that has ended."""
        self._typical_s.pop(kind, None)

    def limit_s(self, kind: Hashable, misses: int = 0) -> float:
        """Return how long a job may take; twice as long after each miss [s]."""
        typical_s = self._typical_s.get(kind)
        first_s = FIRST_S
        if typical_s is not None:
            first_s = max(self._least_s, PATIENCE * typical_s)
        return first_s * float(2 ** min(misses, _MOST_DOUBLINGS))
