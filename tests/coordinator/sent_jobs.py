"""Agents whose jobs are recorded, for tests that answer them by hand."""

from typing import Any

from coordinator.dispatch.events import DispatchEvent, Outcome, Returned


class SentJobs:
    """Agents of a fleet that answer when the test says so.

    Attributes:
        sent: number, agent and payload of each job.
        waits_s: wait of each job [s].
        cancelled: agent and payload of each cancelled job.
        asked: agents that were asked for their progress.
        pauses_s: pause of each ``receive`` [s].
        news: what the next ``receive`` returns.
    """

    def __init__(self, *news: DispatchEvent) -> None:
        self.sent: list[tuple[int, str, bytes]] = []
        self.waits_s: list[float] = []
        self.cancelled: list[tuple[str, bytes]] = []
        self.asked: list[str] = []
        self.pauses_s: list[float] = []
        self.news = list(news)

    def send(self, number: int, agent: str, payload: bytes, wait_s: float, /) -> None:
        self.sent.append((number, agent, payload))
        self.waits_s.append(wait_s)

    def cancel(self, agent: str, payload: bytes, /) -> None:
        self.cancelled.append((agent, payload))

    def ask(self, agent: str, /) -> None:
        self.asked.append(agent)

    def answer(self, outcome: Outcome = "ok", data: bytes = b"x", **other: Any) -> str:  # noqa: ANN401 - any field
        """Let the agent of the newest job answer next; return its name."""
        number, agent, _ = self.sent[-1]
        self.news = [Returned(number, agent, outcome, data, **other)]
        return agent

    def receive(
        self, _timeout_s: float, pause_s: float = 0.0, /
    ) -> list[DispatchEvent]:
        self.pauses_s.append(pause_s)
        news, self.news = self.news, []
        return news
