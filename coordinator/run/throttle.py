"""Simulated time held back to a multiple of real time, for those who watch.

Nothing that happens depends on it: it only says when an arena may go on.
"""


class RealTimeThrottle:
    """How fast arenas may go at most."""

    def __init__(self, speed: float, timestep_s: float) -> None:
        """Hold nobody back yet.

        Args:
            speed: simulated seconds per second; > 0.
            timestep_s: of the physics [s].
        """
        self._step_s = timestep_s / speed
        self._last: dict[int, tuple[int, float]] = {}

    def due_s(self, shard: int, step: int, now_s: float) -> float:
        """Return when an arena may go on from a step [s].

        Args:
            shard: the arena's number.
            step: where it stands; asked once for each step that it goes on from.
            now_s: the time; one that came late does not catch up.
        """
        last_step, last_s = self._last.get(shard, (step, now_s))
        due_s = max(now_s, last_s + (step - last_step) * self._step_s)
        self._last[shard] = (step, due_s)
        return due_s
