"""What comes back every so many births."""


class Rhythm:
    """Comes round once in every interval of births, however they are counted on."""

    def __init__(self, interval: int, start: int) -> None:
        """Count from ``start`` births on."""
        self._interval = interval
        self._next = start + interval

    def comes_round(self, births: int) -> bool:
        """Return whether the time has come; once for all that has passed by then."""
        if births < self._next:
            return False
        self._next += self._interval * ((births - self._next) // self._interval + 1)
        return True
