"""Agents within this process: plain functions in place of the network."""

import time
from collections import deque
from collections.abc import Mapping, Sequence

from coordinator.dispatch.events import AgentKind, DispatchEvent, Joined, Returned
from schema.agent.machine import memory_bytes, shards_that_fit
from schema.agent.request_handler import Compute, answer
from schema.errors import RevolveError
from schema.limits import ADVANCE_REQUEST_BYTES
from schema.wire.codec import decode
from schema.wire.messages import Request


class LocalAgents:
    """One worker and one analyzer that do their jobs during ``receive``."""

    def __init__(self, agents: Mapping[AgentKind, Compute], platform: str) -> None:
        """Initialise agents with the functions that do their work."""
        self._agents = {f"local-{kind}": agents[kind] for kind in sorted(agents)}
        self._asked: deque[tuple[int, str, bytes]] = deque()
        shards = shards_that_fit(memory_bytes(), processes=1)
        self._news: list[DispatchEvent] = [
            Joined(f"local-{kind}", kind, 1, platform, shards)
            for kind in sorted(agents)
        ]

    def send(self, number: int, agent: str, payload: bytes, _wait_s: float, /) -> None:
        """Queue a job; a later ``receive`` does it."""
        self._asked.append((number, agent, payload))

    def cancel(self, _agent: str, _payload: bytes) -> None:
        """Do nothing: one worker's jobs have no copies to cancel."""

    def ask(self, _agent: str, /) -> None:
        """Do nothing: no job is on its way between two calls of ``receive``."""

    def receive(
        self, timeout_s: float, _pause_s: float = 0.0, /
    ) -> Sequence[DispatchEvent]:
        """Do the oldest job and return its outcome; the first call lets agents join."""
        news, self._news = self._news, []
        if self._asked:
            number, agent, payload = self._asked.popleft()
            try:
                request = decode(Request, payload, ADVANCE_REQUEST_BYTES)
                answered = answer(self._agents[agent], request)
                news.append(Returned(number, agent, "ok", answered))
            except RevolveError as error:
                news.append(Returned(number, agent, "error", reason=str(error)))
        elif not news:
            # No other events can come: only the wait is left.
            time.sleep(timeout_s)
        return news
