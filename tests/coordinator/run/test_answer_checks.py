"""Answers about single robots that contradict their requests."""

import math

import pytest
from msgspec.structs import replace

from coordinator.dispatch.events import Joined, Returned
from coordinator.islands.events import (
    Evaluated,
    EvaluationFailed,
    Vetted,
    VettingFailed,
)
from coordinator.run.requests import read_evaluation
from schema.errors import MalformedMessage
from schema.limits import ANSWER_BYTES, LONGEST_REASON
from schema.wire.codec import encode
from schema.wire.messages import Answer, Evaluate, Result, StateMissing, Vet
from tests.coordinator.sent_requests import (
    BIRTH,
    EPOCH,
    JUDGED,
    ROBOT,
    VIABLE,
    SentRequests,
)

ASKED = pytest.mark.parametrize(
    "ask", [Evaluate(BIRTH, ROBOT), Vet(BIRTH, 0, ROBOT)], ids=["evaluate", "vet"]
)
CROWDED = replace(
    VIABLE, is_viable=False, reason="parts 0 and 1 intersect", intersections=((0, 1),)
)

EVALUATIONS: dict[str, Result] = {
    "fitness not a number": replace(JUDGED, fitness=math.nan),
    "infinite velocity": replace(JUDGED, path_velocity=math.inf),
    "a measure that is not asked for": replace(JUDGED, measures=(1.0,)),
    "a report": VIABLE,
    "the result of another kind of job": StateMissing(),
}
REPORTS: dict[str, Result] = {
    "corner not a number": replace(VIABLE, upper=(1.0, math.nan, 1.0)),
    "infinite mass": replace(VIABLE, mass=math.inf),
    "viable with a reason": replace(VIABLE, reason="parts 0 and 1 intersect"),
    "not viable without a reason": replace(CROWDED, reason=""),
    "an evaluation": JUDGED,
}


def check_refused(
    sent_requests: SentRequests, ask: Vet | Evaluate, lie: Returned
) -> None:
    """Fail unless a lie is counted, its agent backs off, and another gets the job."""
    liar, honest = lie.agent, {"one": "two", "judge": "juror"}[lie.agent]
    assert sent_requests.tell(lie) == []
    assert sent_requests.fleet.faults.total("malformed") == 1
    assert [agent for _, agent, _ in sent_requests.sent] == [liar, honest]
    result = VIABLE if isinstance(ask, Vet) else JUDGED
    (event,) = sent_requests.tell(sent_requests.reply(result))
    assert isinstance(event, Vetted | Evaluated)
    # A new job goes to the honest agent, although the other one is idle, too.
    sent_requests.requests.send(ask)
    assert sent_requests.sent[-1][1] == honest
    sent_requests.tell(sent_requests.reply(result))
    sent_requests.wait(10.0)
    sent_requests.requests.send(ask)
    assert sent_requests.sent[-1][1] == liar


@pytest.fixture
def sent_requests() -> SentRequests:
    made = SentRequests()
    made.tell(Joined("juror", "analyzer", 1, "platform"))
    return made


@pytest.mark.parametrize("lie", EVALUATIONS.values(), ids=EVALUATIONS)
def test_false_evaluation_is_refused(sent_requests: SentRequests, lie: Result) -> None:
    ask = Evaluate(BIRTH, ROBOT)
    sent_requests.requests.send(ask)
    check_refused(sent_requests, ask, sent_requests.reply(lie))


@pytest.mark.parametrize("given", [(), (1.0,), (1.0, 2.0, 3.0), (1.0, math.nan)])
def test_evaluation_needs_a_finite_number_for_each_measure(
    given: tuple[float, ...],
) -> None:
    def read(measures: tuple[float, ...]) -> Answer:
        answer = Answer(1, 2, 0.0, replace(JUDGED, measures=measures))
        return read_evaluation(encode(answer), expected=(1, 2), measures=2)

    assert read((1.0, -2.5)).result == replace(JUDGED, measures=(1.0, -2.5))
    with pytest.raises(MalformedMessage, match="measures"):
        read(given)


@pytest.mark.parametrize("lie", REPORTS.values(), ids=REPORTS)
def test_false_report_is_refused(sent_requests: SentRequests, lie: Result) -> None:
    ask = Vet(BIRTH, 0, ROBOT)
    sent_requests.requests.send(ask)
    check_refused(sent_requests, ask, sent_requests.reply(lie))


@pytest.mark.parametrize("wall_s", [-0.1, math.inf, 1e10])
def test_impossible_duration_is_refused(
    sent_requests: SentRequests, wall_s: float
) -> None:
    ask = Evaluate(BIRTH, ROBOT)
    sent_requests.requests.send(ask)
    check_refused(sent_requests, ask, sent_requests.reply(JUDGED, wall_s=wall_s))


def test_a_body_that_intersects_is_no_lie(sent_requests: SentRequests) -> None:
    sent_requests.requests.send(Vet(BIRTH, 0, ROBOT))
    (event,) = sent_requests.tell(sent_requests.reply(CROWDED))
    assert event == Vetted(BIRTH, 0, CROWDED)


@ASKED
def test_an_answer_of_30_mb_is_refused_unread(
    sent_requests: SentRequests, ask: Vet | Evaluate
) -> None:
    """Thirteen of them filled a journal."""
    sent_requests.requests.send(ask)
    lie = sent_requests.reply("x" * 30_000_000)
    with pytest.raises(MalformedMessage) as raised:
        sent_requests.fleet.dispatch._jobs[lie.number].job.read(lie.answer)
    assert raised.value.kind == "too large"
    check_refused(sent_requests, ask, lie)


@ASKED
def test_reasons_are_cut_to_one_printable_line(
    sent_requests: SentRequests, ask: Vet | Evaluate
) -> None:
    sent_requests.requests.send(ask)
    text = "\x1b[2Jgone\r\nsecond\u202e line" + "x" * (ANSWER_BYTES - 200)
    (event,) = sent_requests.tell(sent_requests.reply(text))
    assert isinstance(event, VettingFailed | EvaluationFailed)
    assert event.reason.startswith("?[2Jgone second? linexxx")
    assert event.reason.endswith("x...")
    assert len(event.reason) == LONGEST_REASON


def test_malformed_answers_never_stop_a_run(sent_requests: SentRequests) -> None:
    """They are faults of agents; three errors say that no agent can do a job."""
    sent_requests.requests.send(Evaluate(BIRTH, ROBOT))
    for count in range(1, 8):
        assert sent_requests.tell(sent_requests.reply(VIABLE)) == []
        assert sent_requests.fleet.faults.total("malformed") == count
        sent_requests.wait(10.0)
    (event,) = sent_requests.tell(sent_requests.reply(JUDGED))
    assert isinstance(event, Evaluated)


@pytest.mark.parametrize(
    ("change", "kind"),
    [({"epoch": EPOCH + 1}, "stale"), ({"number": 77}, "stale"), ({}, "impossible")],
)
def test_errors_have_a_kind_for_counts(
    sent_requests: SentRequests, change: dict[str, int], kind: str
) -> None:
    sent_requests.requests.send(Evaluate(BIRTH, ROBOT))
    number = sent_requests.sent[-1][0]
    read = sent_requests.fleet.dispatch._jobs[number].job.read
    with pytest.raises(MalformedMessage) as raised:
        read(sent_requests.reply(VIABLE, **change).answer)
    assert raised.value.kind == kind
    with pytest.raises(MalformedMessage) as raised:
        read(b"\xff")
    assert raised.value.kind == "malformed"
