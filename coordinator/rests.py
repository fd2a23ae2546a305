"""Agents that are given nothing for a while: those that erred or lost a job.

Each rest in a row is twice as long as the one before, up to a limit. Pure.
"""

from collections.abc import Iterator
from heapq import heappop, heappush
from itertools import count

from coordinator.pool import AgentState

REST_S = 0.05
LONGEST_REST_S = 3.2


class Rests:
    """Who rests, and until when."""

    def __init__(self) -> None:
        """Nobody rests."""
        self._until: list[tuple[float, int, str]] = []
        self._order = count()

    @property
    def wake_s(self) -> float | None:
        """When the next rest is over [s]; None if nobody rests."""
        return self._until[0][0] if self._until else None

    def begin(self, agent: AgentState, now_s: float) -> None:
        """Let an agent rest; one rest at a time."""
        if agent.rests:
            return
        agent.rests = True
        rest_s = min(REST_S * 2**agent.failures, LONGEST_REST_S)
        agent.failures += 1
        heappush(self._until, (now_s + rest_s, next(self._order), agent.joined.agent))

    def over(self, now_s: float) -> Iterator[str]:
        """Yield the names of those whose rest is over; some may have left."""
        while self._until and self._until[0][0] <= now_s:
            yield heappop(self._until)[2]
