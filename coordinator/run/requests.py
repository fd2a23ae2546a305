"""Vetting and evaluation requests of a run, checks of their answers, and the results.

An answer that passes is one that a correct agent may give. A wrong value that is
plausible is not found here; cross-checks find it.
"""

from collections.abc import Callable, Sequence
from functools import partial
from types import UnionType

from msgspec import structs

from coordinator.dispatch.events import Deliver, Job, JobKind
from coordinator.dispatch.fleet import JobRouter
from coordinator.islands.events import (
    QUARANTINED,
    Advanced,
    Answered,
    Ask,
    Asked,
    Audited,
    Commanded,
    Evaluated,
    EvaluationFailed,
    ExternalEvent,
    Vetted,
    VettingFailed,
)
from coordinator.run.cross_checks import CrossChecks
from coordinator.run.run_context import RunContext
from schema.errors import NO_MESSAGE, JobRefused, MalformedMessage
from schema.experiment.identity import NO_ORIGIN
from schema.limits import (
    ANSWER_BYTES,
    LONGEST_REASON,
    MOST_PAIRS,
    PAIR_BYTES,
    TRACE_BYTES,
    printable,
)
from schema.plugins.source import plugins_of
from schema.robot.ids import BirthId
from schema.robot.results import Evaluation, Provenance, Report
from schema.wire.codec import decode, encode
from schema.wire.messages import (
    Answer,
    Evaluate,
    Failure,
    Request,
    Result,
    Traced,
    Vet,
)
from schema.wire.trace import check_trace

VETTING_BYTES = ANSWER_BYTES + MOST_PAIRS * PAIR_BYTES

Key = tuple[str, int, BirthId, int]
"""Identifies an open request: kind, requester, birth, number of its attempt."""

Expected = tuple[int, int]
"""Epoch and number of a job."""


class Requests:
    """The vetting and evaluation requests of all islands of a run."""

    def __init__(self, context: RunContext, fleet: JobRouter, audit: float) -> None:
        """Initialise without requests.

        ``audit``: share of evaluations that are done twice.
        """
        self._cross_checks = CrossChecks(audit) if audit else None
        self._context = context
        self._fleet = fleet

    def send(self, command: Vet | Evaluate) -> None:
        """Request the vetting or evaluation of a robot."""
        context = self._context
        if isinstance(command, Vet):
            kind: JobKind = "vet"
            settings, origin, simulated_s = context.vetting, NO_ORIGIN, 0.0
            read: Callable[..., Answer] = read_vetting
        else:
            kind = "evaluate"
            requester = requester_of(command)
            settings = context.evaluation[requester]
            origin = structs.replace(context.origin, island=requester)
            experiment = context.experiments[requester]
            clock, measures = experiment.simulation, experiment.measures.names
            simulated_s = (command.steps or clock.evaluation_steps) * clock.timestep_s
            read = partial(read_evaluation, measures=len(measures))
        run, epoch = context.client
        for number, paired in self._numbers(command):
            request = Request(
                run, epoch, number, command, settings, plugins_of(settings), origin
            )
            own_read = partial(read, expected=(epoch, number))
            about = (context.client, command, own_read, simulated_s)
            self._fleet.request(Job(number, kind, encode(request), paired, *about))

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


def read_vetting(data: bytes, *, expected: Expected) -> Answer:
    """Return the decoded answer to a vetting: a report or a failure.

    ``expected``: epoch and number of the job.

    Raises:
        MalformedMessage: not an answer, the answer to another request, or a report
            with a reason although the body is viable, or without one.
    """
    answer = read_answer(data, expected, Report, VETTING_BYTES)
    report = answer.result
    if isinstance(report, Report) and report.is_viable == bool(report.reason):
        raise impossible("report: exactly a body that is not viable has a reason")
    return answer


def read_evaluation(
    data: bytes, *, expected: Expected, measures: int = 0, is_traced: bool = False
) -> Answer:
    """Return the decoded answer to an evaluation, traced if that is wanted.

    ``expected``: epoch and number of the job.

    Raises:
        MalformedMessage: not an answer, the answer to another request, another number
            of measures, or a trace whose arrays do not fit their shapes.
    """
    kind, most = (Traced, TRACE_BYTES) if is_traced else (Evaluation, ANSWER_BYTES)
    answer = read_answer(data, expected, kind, most)
    result = answer.result
    if isinstance(result, Traced):
        if result.trace is not None:
            check_trace(result.trace)
        result = result.outcome
    if isinstance(result, Evaluation):
        check_count(result.measures, measures)
    return answer


def read_answer(
    data: bytes, expected: Expected, kind: type[Result] | UnionType, most: int
) -> Answer:
    """Return the decoded answer to a job.

    ``expected``: epoch and number of the job. ``kind``: type of the result, unless it
    is a failure.

    Raises:
        MalformedMessage: not an answer, the answer to another request, or another
            kind of result.
    """
    answer = decode(Answer, data, most)
    if (answer.epoch, answer.number) != expected:
        raise MalformedMessage(
            f"answer must be to (epoch, job) {expected}, got "
            f"{(answer.epoch, answer.number)}",
            "stale",
        )
    if not isinstance(answer.result, kind | Failure):
        got = type(answer.result).__name__
        raise impossible(f"answer: got {got}, which is no result of such a job")
    return answer


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


def failure_of(result: object) -> str:
    """Return the reason of a failure as a line that is safe to print."""
    assert isinstance(result, Failure)
    return printable(result.reason, LONGEST_REASON) or NO_MESSAGE


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
    answer = end.answer if isinstance(end.answer, Answer) else None
    result = answer.result if answer else None
    why = failure_of(result) if isinstance(result, Failure) else reason
    if isinstance(request, Vet):
        if isinstance(result, Report):
            if result.reason:
                words = printable(result.reason, LONGEST_REASON)
                result = structs.replace(result, reason=words)
            return Vetted(birth, request.attempt, result)
        why = f"the analyzer {reason}" if reason else why
        return VettingFailed(birth, request.attempt, why)
    wall_s = answer.wall_s if answer else 0.0
    provenance = Provenance(end.agent, end.platform, wall_s)
    about = provenance, request.trial, request.requester, request.point
    if isinstance(result, Evaluation):
        return Evaluated(birth, result, *about)
    if reason:
        why = f"{QUARANTINED}{reason}"
    elif why.startswith(QUARANTINED):
        # Only the coordinator knows that: it counts the deaths.
        why = f"failed: {why}"
    return EvaluationFailed(birth, why, *about)
