"""Agents that live in this process: plain functions in place of the network."""

import time
from collections import deque
from collections.abc import Callable, Mapping, Sequence

from coordinator.dispatch.events import AgentKind, DispatchEvent, Joined, Returned
from schema.errors import RevolveError


class LocalAgents:
    """One worker and one analyzer that answer when they are asked to listen."""

    def __init__(
        self,
        answers: Mapping[AgentKind, Callable[[bytes], bytes]],
        platform: str,
    ) -> None:
        """Offer functions, encoded request to encoded answer, as agents."""
        self._answers = {f"local-{kind}": answers[kind] for kind in sorted(answers)}
        self._asked: deque[tuple[int, str, bytes]] = deque()
        self._news: list[DispatchEvent] = [
            Joined(f"local-{kind}", kind, 1, platform) for kind in sorted(answers)
        ]

    def send(self, number: int, agent: str, payload: bytes) -> None:
        """Hand a job to an agent; it is done at the next ``receive``."""
        self._asked.append((number, agent, payload))

    def cancel(self, _agent: str, _payload: bytes) -> None:
        """Do it all the same: of one worker's jobs there are no copies."""

    def receive(
        self, timeout_s: float, _pause_s: float = 0.0, /
    ) -> Sequence[DispatchEvent]:
        """Do the oldest job; the first call tells who is there."""
        news, self._news = self._news, []
        if self._asked:
            number, agent, payload = self._asked.popleft()
            try:
                answer = self._answers[agent](payload)
                news.append(Returned(number, agent, "ok", answer))
            except RevolveError as error:
                news.append(Returned(number, agent, "error", reason=str(error)))
        elif not news:
            # Nothing ever comes from outside: somebody wants to wait.
            time.sleep(timeout_s)
        return news
