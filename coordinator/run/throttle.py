"""Limits simulated time to a multiple of real time, for viewers.

Results do not depend on it: it only delays the advances of arenas.
"""

from heapq import heappop, heappush
from math import inf

from schema.wire.arena import AdvanceShard


class RealTimeThrottle:
    """Limit of the speed at which arenas advance."""

    def __init__(self, speed: float) -> None:
        """Initialise the throttle."""
        self._speed = speed
        self._last: dict[int, tuple[float, float]] = {}
        self._held_back: list[tuple[float, int, AdvanceShard]] = []

    @property
    def wake_s(self) -> float:
        """Time at which the next delayed advance may start [s]."""
        return self._held_back[0][0] if self._held_back else inf

    def holds_back(self, command: AdvanceShard, begin_s: float, now_s: float) -> bool:
        """Return whether an advance has to wait; if so, ``due`` returns it later.

        ``begin_s``: simulated time at which it begins; each is passed once [s].
        ``now_s``: the time; an arena that is late does not catch up [s].
        """
        shard = command.island
        last_begin_s, last_s = self._last.get(shard, (begin_s, now_s))
        due_s = max(now_s, last_s + (begin_s - last_begin_s) / self._speed)
        self._last[shard] = (begin_s, due_s)
        if due_s > now_s:
            heappush(self._held_back, (due_s, shard, command))
        return due_s > now_s

    def due(self, now_s: float) -> list[AdvanceShard]:
        """Return the advances that need not wait any longer, earliest first."""
        due: list[AdvanceShard] = []
        while self.wake_s <= now_s:
            due.append(heappop(self._held_back)[2])
        return due
