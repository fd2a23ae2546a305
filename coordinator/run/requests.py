"""Breeding and evaluation requests of a run, checks of their answers, and the results.

An answer that passes is one that a correct agent may give. A wrong value that is
plausible is not found here; cross-checks find it.
"""

from collections.abc import Sequence
from functools import partial
from types import UnionType

from msgspec import structs

from coordinator.dispatch.events import Deliver, Job
from coordinator.dispatch.fleet import JobRouter
from coordinator.evolution.encodings import IslandEncoding, encoding_of
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
    MigrationEvent,
)
from coordinator.run.cross_checks import NO_CHECKS, Checks, CrossChecks
from coordinator.run.run_context import RunContext
from schema.agent.request_handler import Compute
from schema.errors import (
    NO_MESSAGE,
    ExperimentError,
    InvalidRobot,
    JobRefused,
    MalformedMessage,
)
from schema.limits import (
    ANSWER_BYTES,
    BRED_BYTES,
    LONGEST_REASON,
    TRACE_BYTES,
    printable,
)
from schema.plugins.source import plugins_of
from schema.robot.ids import BirthId
from schema.robot.results import Evaluation, Provenance
from schema.wire.codec import decode, encode
from schema.wire.messages import (
    Answer,
    Bred,
    Breed,
    Evaluate,
    Failure,
    Request,
    Result,
    Traced,
)
from schema.wire.trace import check_trace

Key = tuple[str, int, BirthId, int]
"""Identifies an open request: kind, requester, birth, number of its attempt."""

Expected = tuple[int, int]
"""Epoch and number of a job."""


class Requests:
    """The breeding and evaluation requests of all islands of a run."""

    def __init__(
        self, context: RunContext, fleet: JobRouter, checks: Checks = NO_CHECKS
    ) -> None:
        """Initialise without requests.

        ``checks``: what of them is done twice.
        """
        self._checks, self._cross_checks = checks, CrossChecks()
        self._context = context
        self._fleet = fleet

    def send(self, command: Breed | Evaluate) -> None:
        """Request the breeding of a child or the evaluation of a robot."""
        if isinstance(command, Breed):
            self._breed(command)
        else:
            self._evaluate(command)

    def _breed(self, work: Breed) -> None:
        context, checks = self._context, self._checks
        island, number = work.birth.island, self._fleet.new_number()
        settings, needs = context.breeding[island]
        request = self._request(number, work, settings, plugins_of(needs))
        read = partial(
            read_bred,
            request=request,
            encoding=encoding_of(context.experiments[island]),
            again=checks.breed,
            is_audited=checks.chooses(work.birth, work.attempt),
        )
        about = (-1, context.client, work, read, 0.0)
        self._fleet.request(Job(number, "breed", encode(request), *about))

    def _evaluate(self, work: Evaluate) -> None:
        context, island = self._context, requester_of(work)
        settings, experiment = context.evaluation[island], context.experiments[island]
        clock, measures = experiment.simulation, experiment.measures.names
        simulated_s = (work.steps or clock.evaluation_steps) * clock.timestep_s
        for number, paired in self._numbers(work):
            request = self._request(number, work, settings, plugins_of(settings))
            expected = request.epoch, number
            read = partial(read_evaluation, expected=expected, measures=len(measures))
            about = (paired, context.client, work, read, simulated_s)
            self._fleet.request(Job(number, "evaluate", encode(request), *about))

    def _request(
        self, number: int, work: Breed | Evaluate, settings: bytes, plugins: str
    ) -> Request:
        run, epoch = self._context.client
        origin = structs.replace(self._context.origin, island=requester_of(work))
        return Request(run, epoch, number, work, settings, plugins, origin)

    def _numbers(self, work: Evaluate) -> list[tuple[int, int]]:
        """Return the number of each job of a request, and of its paired job or -1."""
        first = self._fleet.new_number()
        if not self._checks.chooses(work.birth, work.trial):
            return [(first, -1)]
        second = self._fleet.new_number()
        self._cross_checks.pair(first, second)
        return [(first, second), (second, first)]

    def events(self, end: Deliver) -> list[Answered | Audited]:
        """Return the events that the end of a job leads to.

        Raises:
            JobRefused: several agents cannot do the job; the run stops as it is.
            ExperimentError: no analyzer can breed for this experiment.
        """
        event = _event(end)
        return self._cross_checks.settle(end.job.number, event)


def requester_of(about: Breed | Evaluate | Ask | Answered) -> int:
    """Return the island that requests something, or that is answered."""
    if isinstance(about, Breed | Bred | Ask | Asked):
        return about.birth.island
    return about.birth.island if about.requester is None else about.requester


def island_of(event: ExternalEvent | MigrationEvent) -> int:
    """Return the number of the island that an event is for."""
    if isinstance(event, Advanced | Commanded | MigrationEvent):
        return event.island
    return requester_of(event)


def key_of(about: Breed | Evaluate | Ask | Answered) -> Key:
    """Return what a request and its answer have in common."""
    if isinstance(about, Ask | Asked):
        return ("ask", about.birth.island, about.birth, about.number)
    if isinstance(about, Breed | Bred):
        return ("breed", about.birth.island, about.birth, about.attempt)
    return ("evaluate", requester_of(about), about.birth, about.trial)


def read_bred(
    data: bytes,
    *,
    request: Request,
    encoding: IslandEncoding,
    again: Compute | None = None,
    is_audited: bool = False,
) -> Answer:
    """Return the decoded answer to a request to breed.

    ``again``: breeds in this process, to compare an audited answer, or a failure, which
    ends the run; None: neither is compared.

    Raises:
        MalformedMessage: not an answer, the answer to another request, another number
            of attempts than there may be, a child that cannot live in the experiment,
            or another one than ``again`` gives.
    """
    answer = read_answer(data, (request.epoch, request.number), Bred, BRED_BYTES)
    bred, work = answer.result, request.work
    assert isinstance(work, Breed)
    if isinstance(bred, Bred):
        _check_bred(bred, work, encoding)
        again = again if is_audited else None
    if again is not None and again(request) != bred:
        why = "bred another child than this coordinator, or none"
        raise MalformedMessage(f"birth {work.birth.name}: {why}", "differs")
    return answer


def _check_bred(bred: Bred, work: Breed, encoding: IslandEncoding) -> None:
    """Raise ``MalformedMessage`` for an outcome that is none of a request to breed."""
    if (bred.birth, bred.attempt) != (work.birth, work.attempt):
        raise impossible(f"bred birth {bred.birth.name}, not {work.birth.name}")
    most, tried = work.end - work.attempt, len(bred.reasons)
    if bred.child is None:
        if tried != most:
            raise impossible(f"no child must take {most} attempts, got {tried}")
        return
    if tried >= most:
        raise impossible(f"a child takes <= {most} attempts, got {tried + 1}")
    try:
        encoding.check_newborn(bred.child)
    except InvalidRobot as error:
        raise impossible(f"child: {error}") from None


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
        ExperimentError: no analyzer can breed for this experiment.
    """
    job, request, reason = end.job, end.job.subject, end.reason
    assert isinstance(request, Breed | Evaluate)
    birth = request.birth
    if reason and not end.is_deadly:
        raise JobRefused(
            f"birth {birth.number}: several agents cannot {job.kind} it, the last "
            f"of them {end.agent}: {reason}; fix that and resume"
        )
    answer = end.answer if isinstance(end.answer, Answer) else None
    result = answer.result if answer else None
    if isinstance(request, Breed):
        if isinstance(result, Failure):
            raise ExperimentError(failure_of(result))
        reasons = [f"the analyzer {reason}"] * (request.end - request.attempt)
        if not isinstance(result, Bred):
            return Bred(birth, request.attempt, tuple(reasons))
        reasons = [printable(each, LONGEST_REASON) for each in result.reasons]
        return structs.replace(result, reasons=tuple(reasons)) if reasons else result
    why = failure_of(result) if isinstance(result, Failure) else reason
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
