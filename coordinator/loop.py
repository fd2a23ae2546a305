"""Drives a run: answers in, journal first, then the machines' decisions.

The machines decide and this loop carries out. Nothing that an answer changes is
acted on before the journal has it, so a coordinator that is killed at any point
comes back to the same decisions by replaying its journal.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Protocol

from coordinator.dispatch import Dispatch
from coordinator.events import (
    Advanced,
    Answered,
    Assign,
    Commanded,
    Deliver,
    DispatchEvent,
    Evaluate,
    Evaluated,
    EvaluationFailed,
    Finish,
    IslandCommand,
    Job,
    Journalled,
    Record,
    Requested,
    Returned,
    Started,
    Ticked,
    Vet,
    Vetted,
    VettingFailed,
)
from coordinator.island import Island
from schema.birth import BirthId
from schema.codec import Answer, decode_answer, encode_request, encode_robot
from schema.errors import JobRefused, MalformedMessage, UnexpectedEvent
from schema.evaluation import Evaluation, Provenance, Report
from schema.robot import Robot

Key = tuple[str, BirthId, int]
"""What an open question is known by: kind, birth, attempt."""


class Agents(Protocol):
    """Where jobs go and answers come from: a network, or this process."""

    def send(self, number: int, agent: str, payload: bytes) -> None:
        """Hand a job to an agent; its outcome comes by ``receive``."""

    def receive(self, timeout_s: float) -> Sequence[DispatchEvent]:
        """Return what happened, waiting at most ``timeout_s`` for the first."""


class Log(Protocol):
    """What survives a crash of this process."""

    def append(self, events: Sequence[Answered]) -> None:
        """Keep events, durably, before anybody acts on them."""


class Rows(Protocol):
    """Where table rows go."""

    def write(self, record: Record) -> None:
        """Take one row."""


@dataclass(frozen=True, slots=True)
class Question:
    """What every request of a run carries beside the robot."""

    run: str
    epoch: int
    vetting: bytes
    evaluation: bytes


class Loop:
    """One run's machines and what connects them to the world.

    Attributes:
        malformed: answers that did not decode or did not fit their question.
        dispatch: who does what.
    """

    def __init__(
        self,
        islands: Mapping[int, Island],
        *,
        question: Question,
        agents: Agents,
        log: Log,
        rows: Rows,
    ) -> None:
        """Connect machines; nothing happens before ``start``."""
        self.islands = dict(islands)
        self.dispatch = Dispatch()
        self.malformed = 0
        self._question = question
        self._agents = agents
        self._log = log
        self._rows = rows
        self._numbers = 0
        self._answers: dict[int, Answer] = {}
        self._encoded: dict[BirthId, tuple[Robot, bytes]] = {}

    @property
    def is_finished(self) -> bool:
        """Every island is done."""
        return all(island.is_finished for island in self.islands.values())

    def start(self, history: Iterable[Journalled]) -> None:
        """Begin, or come back: replay a journal, then ask what is still open.

        Args:
            history: the journalled events, oldest first; empty for a new run.

        Raises:
            UnexpectedEvent: the history of another kind of run.
        """
        unanswered: dict[Key, Vet | Evaluate] = {}
        for number in sorted(self.islands):
            asked = self._obey(self.islands[number].handle(Started()))
            unanswered.update((_key(command), command) for command in asked)
        for event in history:
            if isinstance(event, Advanced | Commanded):
                raise UnexpectedEvent(f"no island here is an arena, got {event}")
            unanswered.pop(_key(event), None)
            unanswered.update((_key(command), command) for command in self._tell(event))
        for command in unanswered.values():
            self._request(command)

    def step(self, timeout_s: float, now_s: float) -> int:
        """Take what came and act on it.

        Args:
            timeout_s: how long to wait when nothing is there [s].
            now_s: the time, of any clock that only goes forward [s].

        Returns:
            The number of island events that were taken.
        """
        events: list[Answered] = []
        wake_s = self.dispatch.wake_s
        if wake_s is not None:
            timeout_s = min(timeout_s, max(0.0, wake_s - now_s))
        for event in (Ticked(now_s), *self._agents.receive(timeout_s)):
            for command in self.dispatch.handle(self._checked(event)):
                if isinstance(command, Assign):
                    self._assign(command)
                elif isinstance(command, Deliver):
                    events.append(self._delivered(command))
        if events:
            self._log.append(events)
        for answered in events:
            for question in self._tell(answered):
                self._request(question)
        return len(events)

    def _tell(self, event: Answered) -> list[Vet | Evaluate]:
        """Give an island its answer; return what it asks next."""
        return self._obey(self.islands[event.birth.island].handle(event))

    def _obey(self, commands: Iterable[IslandCommand]) -> list[Vet | Evaluate]:
        """Write the rows; return the questions."""
        asked: list[Vet | Evaluate] = []
        for command in commands:
            match command:
                case Record():
                    self._rows.write(command)
                case Vet() | Evaluate():
                    asked.append(command)
                case Finish():
                    pass
        return asked

    def _request(self, command: Vet | Evaluate) -> None:
        self._numbers += 1
        number, birth = self._numbers, command.birth
        cached = self._encoded.get(birth)
        if cached is not None and cached[0] is command.robot:
            robot = cached[1]
        else:
            robot = encode_robot(command.robot)
        asks = self._question
        if isinstance(command, Vet):
            self._encoded[birth] = (command.robot, robot)
            kind, attempt, settings = "vet", command.attempt, asks.vetting
        else:
            self._encoded.pop(birth, None)
            kind, attempt, settings = "evaluate", 0, asks.evaluation
        payload = encode_request(
            run=asks.run,
            epoch=asks.epoch,
            number=number,
            settings=settings,
            robot=robot,
        )
        job = Job(number, kind, birth, attempt, payload)  # type: ignore[arg-type]
        for reaction in self.dispatch.handle(Requested(job)):
            if isinstance(reaction, Assign):
                self._assign(reaction)

    def _assign(self, command: Assign) -> None:
        self._agents.send(command.job.number, command.agent, command.job.payload)

    def _checked(self, event: DispatchEvent) -> DispatchEvent:
        """Return the event; an answer that is none becomes the agent's error."""
        if not isinstance(event, Returned) or event.outcome != "ok":
            return event
        try:
            answer = decode_answer(event.answer)
        except MalformedMessage as error:
            return self._dropped(event, str(error))
        expected = (self._question.epoch, event.number)
        if (answer.epoch, answer.number) != expected:
            return self._dropped(
                event,
                f"answer must be to (epoch, job) {expected}, "
                f"got {(answer.epoch, answer.number)}",
            )
        self._answers[event.number] = answer
        return event

    def _dropped(self, event: Returned, reason: str) -> Returned:
        """Count an answer of no use and return it as the agent's error."""
        self.malformed += 1
        return replace(event, outcome="error", answer=b"", reason=reason)

    def _delivered(self, command: Deliver) -> Answered:
        """Return the island's event that a finished job comes to.

        Raises:
            JobRefused: no agent that was asked can do it; the run stops as it is.
        """
        job = command.job
        if command.reason:
            raise JobRefused(
                f"birth {job.birth.number}: several agents cannot {job.kind} it, the "
                f"last of them {command.agent}: {command.reason}; mend that and resume"
            )
        answer = self._answers.pop(job.number)
        result = answer.result
        if job.kind == "vet":
            if isinstance(result, Report):
                return Vetted(job.birth, job.attempt, result)
            return VettingFailed(job.birth, job.attempt, str(result))
        platform = self.dispatch.platform(command.agent)
        provenance = Provenance(command.agent, platform, answer.wall_s)
        if isinstance(result, Evaluation):
            return Evaluated(job.birth, result, provenance)
        return EvaluationFailed(job.birth, str(result), provenance)


def _key(about: Answered | Vet | Evaluate) -> Key:
    """Return what a question and its answer have in common."""
    if isinstance(about, Vet | Vetted | VettingFailed):
        return ("vet", about.birth, about.attempt)
    return ("evaluate", about.birth, 0)
