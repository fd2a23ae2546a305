"""How fast something grows, lately."""

from collections import deque

SPAN_S = 10.0
"""Over how long a rate is taken [s]."""


class RateMeter:
    """The rate of a count that somebody looks at now and then."""

    def __init__(self) -> None:
        """Have seen nothing."""
        self._seen: deque[tuple[float, float]] = deque()

    def note(self, now_s: float, count: float) -> None:
        """See how far the count is.

        Args:
            now_s: the time, of any clock that only goes forward [s].
            count: that only grows.
        """
        self._seen.append((now_s, count))
        while now_s - self._seen[0][0] > SPAN_S:
            self._seen.popleft()

    @property
    def per_s(self) -> float:
        """Growth per second over the last seconds; 0 if less than two were seen."""
        if not self._seen:
            return 0.0
        (first_s, first), (last_s, last) = self._seen[0], self._seen[-1]
        return (last - first) / (last_s - first_s) if last_s > first_s else 0.0
