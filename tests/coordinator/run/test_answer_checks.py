"""Answers about single robots that contradict their requests."""

import math
from dataclasses import replace

import pytest

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
from schema.robot.results import Evaluation, Report
from schema.wire import revolve_pb2 as pb
from schema.wire.codec import encode_answer
from schema.wire.messages import Answer, Evaluate, Vet
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

EVALUATIONS: dict[str, Evaluation | Report] = {
    "shorter than requested": replace(JUDGED, simulated_s=11.995),
    "of no length": replace(JUDGED, simulated_s=0.0),
    "fitness not a number": replace(JUDGED, fitness=math.nan),
    "infinite velocity": replace(JUDGED, path_velocity=math.inf),
    "faster than the engine allows": replace(JUDGED, path_velocity=1e13),
    "negative velocity": replace(JUDGED, straight_velocity=-0.01),
    "path shorter than the straight line": replace(JUDGED, path_velocity=0.04),
    "a measure that is not asked for": replace(JUDGED, measures=(1.0,)),
    "a report": VIABLE,
}
REPORTS: dict[str, Evaluation | Report] = {
    "part that does not exist": replace(CROWDED, intersections=((0, 2),)),
    "part with itself": replace(CROWDED, intersections=((1, 1),)),
    "parts in descending order": replace(CROWDED, intersections=((1, 0),)),
    "pair given twice": replace(CROWDED, intersections=((0, 1), (0, 1))),
    "corners swapped": replace(VIABLE, lower=(2.0, 0.0, 0.0)),
    "corner not a number": replace(VIABLE, upper=(1.0, math.nan, 1.0)),
    "corner far away": replace(VIABLE, upper=(1.0, 1e11, 1.0)),
    "no mass": replace(VIABLE, mass=0.0),
    "negative mass": replace(VIABLE, mass=-0.1),
    "motor that the body does not have": replace(VIABLE, motors=2),
    "viable with parts that intersect": replace(VIABLE, intersections=((0, 1),)),
    "not viable without intersections": replace(CROWDED, intersections=()),
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
def test_false_evaluation_is_refused(
    sent_requests: SentRequests, lie: Evaluation | Report
) -> None:
    ask = Evaluate(BIRTH, ROBOT)
    sent_requests.requests.send(ask)
    check_refused(sent_requests, ask, sent_requests.reply(lie))


@pytest.mark.parametrize("given", [(), (1.0,), (1.0, 2.0, 3.0), (1.0, math.nan)])
def test_evaluation_needs_a_finite_number_for_each_measure(
    given: tuple[float, ...],
) -> None:
    def read(measures: tuple[float, ...]) -> Answer:
        answer = encode_answer(Answer(1, 2, 0.0, replace(JUDGED, measures=measures)))
        return read_evaluation(answer, expected=(1, 2), simulated_s=12.0, measures=2)

    assert read((1.0, -2.5)).result == replace(JUDGED, measures=(1.0, -2.5))
    with pytest.raises(MalformedMessage, match="measures: must be"):
        read(given)


@pytest.mark.parametrize("lie", REPORTS.values(), ids=REPORTS)
def test_false_report_is_refused(
    sent_requests: SentRequests, lie: Evaluation | Report
) -> None:
    ask = Vet(BIRTH, 0, ROBOT)
    sent_requests.requests.send(ask)
    check_refused(sent_requests, ask, sent_requests.reply(lie))


@pytest.mark.parametrize("wall_s", [-0.1, math.inf, 1e10])
def test_impossible_duration_is_refused(
    sent_requests: SentRequests, wall_s: float
) -> None:
    ask = Evaluate(BIRTH, ROBOT)
    sent_requests.requests.send(ask)
    number, agent, _ = sent_requests.sent[-1]
    data = encode_answer(Answer(EPOCH, number, wall_s, JUDGED))
    check_refused(sent_requests, ask, Returned(number, agent, "ok", data))


def test_reevaluation_must_take_its_own_time(sent_requests: SentRequests) -> None:
    ask = Evaluate(BIRTH, ROBOT, trial=1, steps=3000)
    sent_requests.requests.send(ask)
    assert sent_requests.tell(sent_requests.reply(JUDGED)) == []
    longer = replace(JUDGED, simulated_s=15.0)
    (event,) = sent_requests.tell(sent_requests.reply(longer))
    assert isinstance(event, Evaluated)


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
    number, agent, _ = sent_requests.sent[-1]
    message = pb.Answer(epoch=EPOCH, number=number, failure="x" * 30_000_000)
    lie = Returned(number, agent, "ok", message.SerializeToString())
    with pytest.raises(MalformedMessage) as raised:
        sent_requests.fleet.dispatch._jobs[number].job.read(lie.answer)
    assert raised.value.kind == "too large"
    check_refused(sent_requests, ask, lie)


@ASKED
def test_reasons_are_cut_to_one_printable_line(
    sent_requests: SentRequests, ask: Vet | Evaluate
) -> None:
    sent_requests.requests.send(ask)
    number, agent, _ = sent_requests.sent[-1]
    text = "\x1b[2Jgone\r\nsecond\u202e line" + "x" * (ANSWER_BYTES - 200)
    message = pb.Answer(epoch=EPOCH, number=number, failure=text)
    data = message.SerializeToString()
    (event,) = sent_requests.tell(Returned(number, agent, "ok", data))
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
