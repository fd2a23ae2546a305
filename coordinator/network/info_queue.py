"""Agents that are to be asked for their properties, and when."""

from collections import deque
from heapq import heappop, heappush
from itertools import count

from schema.agent.topics import Member
from schema.limits import MOST_MEMBERS

SHARE = 0.1
"""Greatest share of the coordinator's time that asking takes."""
ASK_AGAIN_S = 1.0
LONGEST_PAUSE_S = 32.0


class InfoQueue:
    """Order in which agents are asked: newest and oldest in turn, then silent ones.

    A query takes the hub longer the more tokens there are, milliseconds with thousands.
    Thousands of tokens without an agent must not delay the runs, nor an agent that came
    just before or comes just after them.
    """

    def __init__(self) -> None:
        self._new: deque[Member] = deque(maxlen=MOST_MEMBERS)
        self._again: list[tuple[float, int, Member]] = []
        self._order = count()
        self._pause_until_s = 0.0
        self._is_oldest_next = False

    def add(self, member: Member) -> None:
        """Add an agent that is to be asked as soon as possible."""
        self._new.append(member)

    def add_again(self, member: Member, silences: int, now_s: float) -> None:
        """Add an agent that is to be asked after a pause.

        Args:
            member: the agent.
            silences: how often it was asked without an answer.
            now_s: the time, of a monotonic clock [s].
        """
        pause_s = min(ASK_AGAIN_S * 2.0 ** min(silences - 1, 9), LONGEST_PAUSE_S)
        heappush(self._again, (now_s + pause_s, next(self._order), member))

    def take(self, now_s: float) -> Member | None:
        """Remove and return the next agent to ask; None if none is due."""
        if now_s < self._pause_until_s:
            return None
        if self._new:
            is_oldest = self._is_oldest_next
            self._is_oldest_next = not is_oldest
            return self._new.popleft() if is_oldest else self._new.pop()
        if self._again and self._again[0][0] <= now_s:
            return heappop(self._again)[2]
        return None

    def spent(self, began_s: float, now_s: float) -> None:
        """Note how long asking one agent took; the next one has to wait accordingly."""
        self._pause_until_s = now_s + (now_s - began_s) * (1.0 / SHARE - 1.0)
