"""Vetting and evaluation requests of a run, and their results."""

from functools import partial

from msgspec import structs

from coordinator.dispatch.events import Deliver, Job, JobKind, Read
from coordinator.dispatch.fleet import Fleet
from coordinator.islands.events import (
    Advanced,
    Answered,
    Ask,
    Asked,
    Audited,
    Commanded,
    Evaluate,
    Evaluated,
    EvaluationFailed,
    ExternalEvent,
    Vet,
    Vetted,
    VettingFailed,
)
from coordinator.run.answer_checks import read_evaluation, read_vetting
from coordinator.run.cross_checks import CrossChecks
from coordinator.run.run_context import RunContext
from schema.errors import JobRefused
from schema.experiment.identity import NO_IDENTITY, Identity
from schema.plugins.source import plugins_of
from schema.robot.ids import BirthId
from schema.robot.results import Evaluation, Provenance, Report
from schema.robot.robot import Robot
from schema.wire.codec import (
    Answer,
    encode_body,
    encode_brain,
    encode_request,
    encode_robot,
)

QUARANTINED = "quarantined: "
"""Prefix of the reason why a robot that crashes its processes has no evaluation."""
REMEMBERED = 256
"""Number of vetted bodies whose bytes are kept for the robot's evaluation."""

Key = tuple[str, int, BirthId, int]
"""Identifies an open request: kind, requester, birth, number of its attempt."""


class Requests:
    """The vetting and evaluation requests of all islands of a run."""

    def __init__(self, context: RunContext, fleet: Fleet, audit: float = 0.0) -> None:
        """Initialise without requests.

        Args:
            context: what all requests have in common.
            fleet: the agents.
            audit: share of evaluations that are done twice.
        """
        self._cross_checks = CrossChecks(audit) if audit else None
        self._context = context
        self._fleet = fleet
        self._bodies: dict[BirthId, tuple[Robot, bytes]] = {}

    def send(self, command: Vet | Evaluate) -> None:
        """Request the vetting or evaluation of a robot."""
        context = self._context
        if isinstance(command, Vet):
            kind: JobKind = "vet"
            steps, settings, identity = 0, context.vetting, NO_IDENTITY
            robot = self._body(command)
        else:
            kind = "evaluate"
            requester = requester_of(command)
            steps, settings = command.steps, context.evaluation[requester]
            origin = structs.replace(context.origin, island=requester)
            identity = Identity(origin, command.birth, command.trial)
            robot = self._robot(command)
        run, epoch = context.client
        for number, twin in self._numbers(command):
            payload = encode_request(
                run=run,
                epoch=epoch,
                number=number,
                settings=settings,
                robot=robot,
                steps=steps,
                identity=identity,
                plugins=plugins_of(settings),
            )
            read = self._reader(command, (epoch, number))
            self._fleet.request(
                Job(number, kind, payload, twin, context.client, command, read)
            )

    def _reader(self, command: Vet | Evaluate, expected: tuple[int, int]) -> Read:
        """Return what decodes the answer to a job, and checks it against the job.

        Args:
            command: of the job.
            expected: epoch and number of the job.
        """
        context = self._context
        if isinstance(command, Vet):
            return partial(
                read_vetting,
                expected=expected,
                robot=command.robot,
                space=context.space,
            )
        own = context.experiments[requester_of(command)]
        clock = own.simulation
        steps = command.steps or clock.warmup_steps + clock.window_steps
        return partial(
            read_evaluation,
            expected=expected,
            simulated_s=steps * clock.timestep_s,
            measures=len(own.measures.names),
        )

    def _body(self, command: Vet) -> bytes:
        """Return the bytes of a body, and keep them for its robot's evaluation."""
        body = encode_body(command.robot)
        self._bodies[command.birth] = (command.robot, body)
        if len(self._bodies) > REMEMBERED:
            # The oldest: robots of an arena are never evaluated.
            del self._bodies[next(iter(self._bodies))]
        return body

    def _robot(self, command: Evaluate) -> bytes:
        """Return the bytes of a robot; those of its body may have been kept."""
        vetted, body = self._bodies.pop(command.birth, (None, b""))
        if vetted is command.robot:
            return body + encode_brain(command.robot)
        return encode_robot(command.robot)

    def _numbers(self, command: Vet | Evaluate) -> list[tuple[int, int]]:
        """Return the number of each job of a request, and of its twin or -1."""
        first, checks = self._fleet.new_number(), self._cross_checks
        if checks is None or isinstance(command, Vet) or not checks.chooses(command):
            return [(first, -1)]
        second = self._fleet.new_number()
        checks.pair(first, second)
        return [(first, second), (second, first)]

    def events(self, end: Deliver) -> list[Answered | Audited]:
        """Return the events that the end of a job leads to.

        Raises:
            JobRefused: several agents cannot do the job; the run stops as it is.
        """
        event = _event(end)
        if self._cross_checks is None:
            return [event]
        return self._cross_checks.settle(end.job.number, event)


def requester_of(about: Vet | Evaluate | Ask | Answered) -> int:
    """Return the island that requests something, or that is answered."""
    if isinstance(about, Vet | Vetted | VettingFailed | Ask | Asked):
        return about.birth.island
    return about.birth.island if about.requester is None else about.requester


def island_of(event: ExternalEvent) -> int:
    """Return the number of the island that an event is for."""
    if isinstance(event, Advanced | Commanded):
        return event.island
    return requester_of(event)


def key_of(about: Vet | Evaluate | Ask | Answered) -> Key:
    """Return what a request and its answer have in common."""
    if isinstance(about, Ask | Asked):
        return ("ask", about.birth.island, about.birth, about.number)
    if isinstance(about, Vet | Vetted | VettingFailed):
        return ("vet", about.birth.island, about.birth, about.attempt)
    return ("evaluate", requester_of(about), about.birth, about.trial)


def is_quarantined(event: EvaluationFailed) -> bool:
    """Return whether a robot has no evaluation because it crashes its processes."""
    return event.reason.startswith(QUARANTINED)


def _event(end: Deliver) -> Answered:
    """Return the island's event for the end of a job.

    Raises:
        JobRefused: several agents cannot do it.
    """
    job, request, reason = end.job, end.job.subject, end.reason
    assert isinstance(request, Vet | Evaluate)
    birth = request.birth
    if reason and not end.is_deadly:
        raise JobRefused(
            f"birth {birth.number}: several agents cannot {job.kind} it, the last "
            f"of them {end.agent}: {reason}; fix that and resume"
        )
    wall_s, result = 0.0, None
    if isinstance(end.answer, Answer):
        wall_s, result = end.answer.wall_s, end.answer.result
    if isinstance(request, Vet):
        if isinstance(result, Report):
            return Vetted(birth, request.attempt, result)
        why = f"the analyzer {reason}" if reason else str(result)
        return VettingFailed(birth, request.attempt, why)
    provenance = Provenance(end.agent, end.platform, wall_s)
    trial, requester = request.trial, request.requester
    if isinstance(result, Evaluation):
        return Evaluated(birth, result, provenance, trial, requester)
    why = f"{QUARANTINED}{reason}" if reason else str(result)
    return EvaluationFailed(birth, why, provenance, trial, requester)
