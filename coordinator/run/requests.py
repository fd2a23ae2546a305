"""Single robots' questions, to analyzers and workers, and what comes of them."""

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Self

from msgspec import structs

from coordinator.dispatch.events import Deliver, Job, JobKind, Returned
from coordinator.dispatch.fleet import Fleet
from coordinator.islands.events import (
    Answered,
    Audited,
    Evaluate,
    Evaluated,
    EvaluationFailed,
    Vet,
    Vetted,
    VettingFailed,
    requester_of,
)
from coordinator.run.cross_checks import CrossChecks
from schema.errors import JobRefused, MalformedMessage
from schema.experiment.document import Experiment, island_count, island_experiment
from schema.experiment.identity import NO_IDENTITY, Identity, Origin
from schema.experiment.plugin_source import plugins_of
from schema.experiment.settings import (
    arena_settings,
    evaluation_settings,
    vetting_settings,
)
from schema.robot.ids import BirthId
from schema.robot.results import Evaluation, Provenance, Report
from schema.robot.robot import Robot
from schema.wire.codec import (
    Answer,
    decode_answer,
    encode_body,
    encode_brain,
    encode_request,
    encode_robot,
)

QUARANTINED = "quarantined: "
"""How the reason begins why a robot that ends its processes has no evaluation."""
REMEMBERED = 256
"""Robots whose bodies' bytes are kept from their vetting to their evaluation."""


@dataclass(frozen=True, slots=True)
class RunContext:
    """What every request of a run carries beside the robot or the changes.

    Attributes:
        run, epoch: of the coordinator.
        origin: the run, as what noise is drawn by; the island is each request's.
        vetting: settings for analyzers, as JSON.
        evaluation, arena: settings for workers, as JSON, by island.
    """

    run: str
    epoch: int
    origin: Origin
    vetting: bytes
    evaluation: Mapping[int, bytes]
    arena: Mapping[int, bytes] = field(default_factory=dict)

    @classmethod
    def of(cls, run: str, epoch: int, experiment: Experiment, origin: Origin) -> Self:
        """Return what a run of an experiment asks with."""
        owns = {
            number: island_experiment(experiment, number)
            for number in range(island_count(experiment))
        }
        return cls(
            run,
            epoch,
            origin,
            vetting_settings(experiment),
            {number: evaluation_settings(own) for number, own in owns.items()},
            {
                number: arena_settings(own, structs.replace(origin, island=number))
                for number, own in owns.items()
                if own.arena
            },
        )


class Requests:
    """The questions of all islands of a run.

    Attributes:
        malformed: answers that did not decode or did not fit their question.
    """

    def __init__(self, context: RunContext, fleet: Fleet, audit: float = 0.0) -> None:
        """Have nothing to ask yet.

        Args:
            context: what all of them have in common.
            fleet: whom to ask.
            audit: share of evaluations that are done twice.
        """
        self.malformed = 0
        self._cross_checks = CrossChecks(audit)
        self._context = context
        self._fleet = fleet
        self._open: dict[int, Vet | Evaluate] = {}
        self._came: list[Answered | Audited] = []
        self._refusal: JobRefused | None = None
        self._answers: dict[int, Answer] = {}
        self._bodies: dict[BirthId, tuple[Robot, bytes]] = {}

    def ask(self, command: Vet | Evaluate) -> None:
        """Have a robot vetted or evaluated."""
        birth = command.birth
        asks = self._context
        if isinstance(command, Vet):
            robot = self._body(command)
            attempt, steps, settings = command.attempt, 0, asks.vetting
            identity = NO_IDENTITY
        else:
            attempt, steps = command.trial, command.steps
            requester = requester_of(command)
            settings = asks.evaluation[requester]
            origin = structs.replace(asks.origin, island=requester)
            identity = Identity(origin, birth, attempt)
            robot = self._robot(command)
        kind: JobKind = "vet" if isinstance(command, Vet) else "evaluate"
        for number, twin in self._numbers(command):
            payload = encode_request(
                run=asks.run,
                epoch=asks.epoch,
                number=number,
                settings=settings,
                robot=robot,
                steps=steps,
                identity=identity,
                plugins=plugins_of(settings),
            )
            self._open[number] = command
            self._fleet.ask(Job(number, kind, birth, attempt, payload, twin), self)

    def _body(self, command: Vet) -> bytes:
        """Return the bytes of a body, and keep them for its robot's evaluation."""
        body = encode_body(command.robot)
        self._bodies[command.birth] = (command.robot, body)
        if len(self._bodies) > REMEMBERED:
            # The eldest: no robot of an arena is ever evaluated.
            del self._bodies[next(iter(self._bodies))]
        return body

    def _robot(self, command: Evaluate) -> bytes:
        """Return the bytes of a robot; those of its body may be there already."""
        vetted, body = self._bodies.pop(command.birth, (None, b""))
        if vetted is command.robot:
            return body + encode_brain(command.robot)
        return encode_robot(command.robot)

    def _numbers(self, command: Vet | Evaluate) -> list[tuple[int, int]]:
        """Return the number of each job for a question, and of its twin or -1."""
        first = self._fleet.new_number()
        if isinstance(command, Vet) or not self._cross_checks.chooses(command):
            return [(first, -1)]
        second = self._fleet.new_number()
        self._cross_checks.pair(first, second)
        return [(first, second), (second, first)]

    def is_of(self, run: str, epoch: int) -> bool:
        """Return whether the questions are those of a run's incarnation."""
        return (run, epoch) == (self._context.run, self._context.epoch)

    def deliver(self, command: Deliver) -> None:
        """Keep the end of a job until ``take``."""
        job = command.job
        asked = self._open.pop(job.number)
        requester = asked.requester if isinstance(asked, Evaluate) else None
        if command.is_deadly:
            self._came += self._cross_checks.settle(
                job.number, _quarantined(command, requester)
            )
            return
        if not command.reason:
            self._came += self._cross_checks.settle(
                job.number, self._answered(command, requester)
            )
            return
        self._refusal = JobRefused(
            f"birth {job.birth.number}: several agents cannot {job.kind} it, the last "
            f"of them {command.agent}: {command.reason}; mend that and resume"
        )

    def take(self) -> list[Answered | Audited]:
        """Return the answers that came since the last call.

        Raises:
            JobRefused: no agent that was asked can do a job; the run stops as it is.
        """
        if self._refusal is not None:
            raise self._refusal
        came, self._came = self._came, []
        return came

    def checked(self, event: Returned) -> Returned:
        """Return the event; an answer that is none becomes the agent's error."""
        if event.outcome != "ok":
            return event
        try:
            answer = decode_answer(event.answer)
        except MalformedMessage as error:
            return self._dropped(event, str(error))
        expected = (self._context.epoch, event.number)
        if (answer.epoch, answer.number) != expected:
            return self._dropped(
                event,
                f"answer must be to (epoch, job) {expected}, "
                f"got {(answer.epoch, answer.number)}",
            )
        is_vet = isinstance(self._open[event.number], Vet)
        unfit = Evaluation if is_vet else Report
        if isinstance(answer.result, unfit):
            return self._dropped(event, f"the answer is of type {unfit.__name__}")
        self._answers[event.number] = answer
        return event

    def _dropped(self, event: Returned, reason: str) -> Returned:
        """Count an answer of no use and return it as the agent's error."""
        self.malformed += 1
        return dataclasses.replace(event, outcome="error", answer=b"", reason=reason)

    def _answered(self, command: Deliver, requester: int | None) -> Answered:
        """Return the island's event that a finished job comes to."""
        job = command.job
        answer = self._answers.pop(job.number)
        result = answer.result
        if job.kind == "vet":
            if isinstance(result, Report):
                return Vetted(job.birth, job.attempt, result)
            return VettingFailed(job.birth, job.attempt, str(result))
        platform = self._fleet.dispatch.platform(command.agent)
        provenance = Provenance(command.agent, platform, answer.wall_s)
        if isinstance(result, Evaluation):
            return Evaluated(job.birth, result, provenance, job.attempt, requester)
        reason = str(result)
        return EvaluationFailed(job.birth, reason, provenance, job.attempt, requester)


def is_quarantined(event: EvaluationFailed) -> bool:
    """Return whether a robot has no evaluation because it ends its processes."""
    return event.reason.startswith(QUARANTINED)


def _quarantined(
    command: Deliver, requester: int | None
) -> VettingFailed | EvaluationFailed:
    """Return what it comes to that a job ends whoever does it."""
    job = command.job
    if job.kind == "vet":
        return VettingFailed(job.birth, job.attempt, f"the analyzer {command.reason}")
    why = f"{QUARANTINED}{command.reason}"
    signed = Provenance(command.agent)
    return EvaluationFailed(job.birth, why, signed, job.attempt, requester)
