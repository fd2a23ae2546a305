"""Vetting and evaluation requests of a run, checks of their answers, and the results.

An answer that passes is one that a correct agent may give. A wrong value that is
plausible is not found here; cross-checks find it.
"""

from collections.abc import Callable, Sequence
from functools import partial
from itertools import pairwise

from msgspec import structs

from coordinator.dispatch.events import Deliver, Job, JobKind
from coordinator.dispatch.fleet import Fleet
from coordinator.islands.events import (
    QUARANTINED,
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
from coordinator.run.cross_checks import CrossChecks
from coordinator.run.run_context import RunContext
from schema.errors import JobRefused, MalformedMessage
from schema.experiment.identity import NO_IDENTITY, Identity
from schema.limits import GREATEST_COORDINATE, GREATEST_MASS, GREATEST_VELOCITY
from schema.parts import BodySpace
from schema.plugins.source import plugins_of
from schema.robot.ids import BirthId
from schema.robot.results import Evaluation, Provenance, Report
from schema.robot.robot import Robot, motor_count
from schema.wire.codec import (
    Answer,
    decode_answer,
    encode_body,
    encode_brain,
    encode_request,
    encode_robot,
)

REMEMBERED = 256
"""Number of vetted bodies whose bytes are kept for the robot's evaluation."""
_ROUNDING = 1e-9
"""Relative error that sums of distances may have."""

Key = tuple[str, int, BirthId, int]
"""Identifies an open request: kind, requester, birth, number of its attempt."""

Expected = tuple[int, int]
"""Epoch and number of a job."""


class Requests:
    """The vetting and evaluation requests of all islands of a run."""

    def __init__(self, context: RunContext, fleet: Fleet, audit: float) -> None:
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
            robot, simulated_s = self._body(command), 0.0
            read: Callable[..., Answer] = partial(
                read_vetting, robot=command.robot, space=context.space
            )
        else:
            kind = "evaluate"
            requester = requester_of(command)
            steps, settings = command.steps, context.evaluation[requester]
            origin = structs.replace(context.origin, island=requester)
            identity = Identity(origin, command.birth, command.trial)
            robot = self._robot(command)
            experiment = context.experiments[requester]
            clock, measures = experiment.simulation, experiment.measures.names
            simulated_s = (steps or clock.evaluation_steps) * clock.timestep_s
            read = partial(
                read_evaluation, simulated_s=simulated_s, measures=len(measures)
            )
        run, epoch = context.client
        for number, paired in self._numbers(command):
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
            own_read = partial(read, expected=(epoch, number))
            about = (context.client, command, own_read, simulated_s)
            self._fleet.request(Job(number, kind, payload, paired, *about))

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
        """Return the number of each job of a request, and of its paired job or -1."""
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


def read_vetting(
    data: bytes, *, expected: Expected, robot: Robot, space: BodySpace
) -> Answer:
    """Return the decoded answer to a vetting.

    Args:
        data: bytes of the answer.
        expected: epoch and number of the job.
        robot: whose body is vetted.
        space: its part types.

    Raises:
        MalformedMessage: not an answer, the answer to another request, or a report
            that no such body has.
    """
    count = len(robot.parts)
    answer = decode_answer(data, count * (count - 1) // 2)
    check_job(answer.epoch, answer.number, expected)
    report = answer.result
    if isinstance(report, Evaluation):
        raise impossible("a vetting must give a report, got an evaluation")
    if isinstance(report, Report):
        _check_report(report, robot, space)
    return answer


def read_evaluation(
    data: bytes, *, expected: Expected, simulated_s: float, measures: int = 0
) -> Answer:
    """Return the decoded answer to an evaluation.

    Args:
        data: bytes of the answer.
        expected: epoch and number of the job.
        simulated_s: length of the evaluation [s].
        measures: number of measures.

    Raises:
        MalformedMessage: not an answer, the answer to another request, another length
            or number of measures, or velocities that are not possible.
    """
    answer = decode_answer(data, 0)
    check_job(answer.epoch, answer.number, expected)
    found = answer.result
    if isinstance(found, Report):
        raise impossible("an evaluation must give an evaluation, got a report")
    if isinstance(found, Evaluation):
        if found.simulated_s != simulated_s:
            raise impossible(
                f"evaluation: must take {simulated_s} s, got {found.simulated_s} s"
            )
        check_velocities(found.path_velocity, found.straight_velocity)
        check_count(found.measures, measures)
    return answer


def check_job(epoch: int, number: int, expected: Expected) -> None:
    """Raise unless an answer belongs to a job.

    Raises:
        MalformedMessage: it belongs to another one.
    """
    if (epoch, number) != expected:
        raise MalformedMessage(
            f"answer must be to (epoch, job) {expected}, got {(epoch, number)}", "stale"
        )


def check_velocities(path: float, straight: float) -> None:
    """Raise unless a track can have these velocities [m/s].

    Raises:
        MalformedMessage: below 0, or a path shorter than the straight line.
    """
    if not (0.0 <= straight <= path * (1.0 + _ROUNDING) + _ROUNDING):
        raise impossible(
            "velocities: must be 0 <= straight <= path, got straight "
            f"{straight} m/s, path {path} m/s"
        )
    if path > GREATEST_VELOCITY:
        raise impossible(
            f"path velocity: must be <= {GREATEST_VELOCITY:g} m/s, got {path}"
        )


def check_count(measures: Sequence[float], wanted: int) -> None:
    """Raise unless there is one number for each measure of the experiment.

    Raises:
        MalformedMessage: another count.
    """
    if len(measures) != wanted:
        raise impossible(f"measures: must be {wanted} numbers, got {len(measures)}")


def impossible(why: str) -> MalformedMessage:
    """Return the error of an answer that contradicts its request."""
    return MalformedMessage(why, "impossible")


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
    if not reason and why.startswith(QUARANTINED):
        # Only the coordinator knows that: it counts the deaths.
        why = f"failed: {why}"
    return EvaluationFailed(birth, why, provenance, trial, requester)


def _check_report(report: Report, robot: Robot, space: BodySpace) -> None:
    count = len(robot.parts)
    pairs = report.intersections
    are_parts = all(first < second < count for first, second in pairs)
    if not are_parts or any(a >= b for a, b in pairwise(pairs)):
        raise impossible(
            f"report: intersections must be ascending pairs of 0..{count - 1}"
        )
    motors = motor_count(robot, space)
    if report.motors != motors:
        raise impossible(f"report: motors must be {motors}, got {report.motors}")
    if report.is_viable == bool(pairs or not motors) or (
        not report.is_viable and not report.reason
    ):
        raise impossible(
            "report: a body is viable if no parts intersect and it has a motor, and "
            f"otherwise there is a reason; got {len(pairs)} intersections, {motors} "
            f"motors, viable {report.is_viable}, reason {report.reason!r}"
        )
    corners = (*report.lower, *report.upper)
    if any(low > high for low, high in zip(report.lower, report.upper, strict=True)):
        raise impossible(f"report: lower must be <= upper, got {corners}")
    if max(map(abs, corners)) > GREATEST_COORDINATE:
        raise impossible(f"report: corners must be finite positions, got {corners}")
    if not 0.0 < report.mass <= GREATEST_MASS:
        raise impossible(
            f"report: mass must be in (0, {GREATEST_MASS:g}] kg, got {report.mass}"
        )
