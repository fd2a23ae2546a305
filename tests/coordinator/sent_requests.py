"""Agents whose jobs are recorded, and requests to them about single robots."""

from typing import Any

from msgspec.structs import replace

from coordinator.dispatch.events import (
    Client,
    Deliver,
    DispatchEvent,
    Joined,
    Outcome,
    Returned,
    Ticked,
)
from coordinator.dispatch.fleet import JobRouter
from coordinator.islands.events import Answered, Audited
from coordinator.run.cross_checks import NO_CHECKS, Checks
from coordinator.run.requests import Requests
from coordinator.run.run_context import RunContext
from schema.experiment.document import Experiment
from schema.experiment.identity import Origin
from schema.experiment.settings import breeding_settings
from schema.limits import REQUEST_BYTES
from schema.parts import BUILT_IN
from schema.robot.brain import Brain, Connection, Neuron
from schema.robot.ids import BirthId
from schema.robot.results import Evaluation
from schema.robot.robot import Part, Robot
from schema.wire.codec import decode, encode
from schema.wire.messages import Answer, Request, Result

EPOCH = 3
CLIENT = Client("run", EPOCH)
ORIGIN = Origin(seed=5, run=2)
BIRTH = BirthId(0, 7)
ROBOT = Robot(
    (
        Part("Core", -1, -1, -1, 0, (0.5, 0.5, 0.5)),
        Part("ActiveHinge", 0, 0, 0, 0, (0.5, 0.5, 0.5)),
    ),
    Brain(
        (
            *(Neuron("input", "Input", 0) for _ in range(6)),
            Neuron("output", "Simple", 1, (0.25, 0.5)),
            Neuron("hidden", "Simple", 0, (0.25, 0.5)),
        ),
        (Connection(0, 6, 0.75),),
    ),
)
EXPERIMENT = Experiment(name="requests")
SETTINGS = breeding_settings(EXPERIMENT)
JUDGED = Evaluation(0.25, 0.06, 0.05, 12.0)


def request_of(payload: bytes) -> Request:
    """Return the request of a job."""
    return decode(Request, payload, REQUEST_BYTES)


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


class SentRequests(SentJobs):
    """Requests whose jobs are recorded, with two workers and two analyzers."""

    def __init__(
        self, evaluation: bytes = b'"evaluation"', checks: Checks = NO_CHECKS
    ) -> None:
        super().__init__()
        self.fleet = JobRouter(self)
        self.now_s = 0.0
        context = RunContext(
            CLIENT,
            ORIGIN,
            {0: (SETTINGS, evaluation)},
            {0: evaluation, 2: evaluation},
            {},
            {0: EXPERIMENT, 2: EXPERIMENT},
            BUILT_IN,
        )
        self.requests = Requests(context, self.fleet, checks)
        for name in ("one", "two"):
            self.tell(Joined(name, "worker", 1, f"platform-{name}"))
        for name in ("judge", "juror"):
            self.tell(Joined(name, "analyzer", 1, "platform"))
        self.tell(Ticked(0.0))

    def tell(self, event: DispatchEvent) -> list[Answered | Audited]:
        """Pass an event to the fleet; return the island's events that follow."""
        self.fleet.tell(event)
        ends = self.fleet.listen(0.0, self.now_s).get(CLIENT, ())
        found = []
        for end in ends:
            assert isinstance(end, Deliver)
            found += self.requests.events(end)
        return found

    def wait(self, seconds: float) -> None:
        """Let time pass."""
        self.now_s += seconds
        self.tell(Ticked(self.now_s))

    def reply(self, result: Result, /, **changes: Any) -> Returned:  # noqa: ANN401
        """Return the answer to the newest job, with other values of some fields."""
        number, agent, _ = self.sent[-1]
        answer = replace(Answer(EPOCH, number, 0.5, result), **changes)
        return Returned(number, agent, "ok", encode(answer))
