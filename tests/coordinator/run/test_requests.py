"""Requests about single robots: results of answers, and lies that are refused."""

import math
from functools import partial
from typing import Literal

import pytest
from msgspec.structs import astuple, replace

from coordinator.dispatch.events import AgentKind, Joined, Left, Returned
from coordinator.islands.events import (
    QUARANTINED,
    Evaluated,
    EvaluationFailed,
)
from coordinator.islands.island import Island
from coordinator.run.cross_checks import Checks
from coordinator.run.requests import read_evaluation
from schema.errors import ExperimentError, JobRefused, MalformedMessage
from schema.experiment.identity import Origin
from schema.limits import ANSWER_BYTES, LONGEST_REASON
from schema.robot.brain import Connection
from schema.robot.genome import Node
from schema.robot.ids import BirthId
from schema.robot.results import Provenance
from schema.robot.robot import Part, Robot
from schema.wire.codec import encode, fingerprint
from schema.wire.genome_bytes import encode_genome
from schema.wire.messages import (
    Answer,
    Array,
    Bred,
    Breed,
    Crash,
    Evaluate,
    Failure,
    PackedTrace,
    Request,
    Result,
    RunningJob,
    StateMissing,
    Traced,
)
from tests.coordinator.breeding import bred, failed
from tests.coordinator.sent_requests import (
    BIRTH,
    EPOCH,
    EXPERIMENT,
    JUDGED,
    ORIGIN,
    ROBOT,
    SETTINGS,
    SentRequests,
    request_of,
)

ISLAND = Island(EXPERIMENT, ORIGIN.seed, ORIGIN.run)
EVALUATE, BREED = Evaluate(BIRTH, ROBOT), Breed(BIRTH, 5, 10)
CHILD = bred(ISLAND, BREED, lambda _, attempt: "crowded" if attempt < 7 else "")
ASKED = pytest.mark.parametrize("ask", [EVALUATE, BREED], ids=["evaluate", "breed"])
EVALUATION = b'{"fitness":{"function":"plugged:speed"},"space":["schema.parts:CORE"]}'


@pytest.fixture
def sent_requests() -> SentRequests:
    return SentRequests()


@pytest.mark.parametrize(
    ("work", "settings", "plugins", "origin"),
    [
        # The plug-in is not here.
        (BREED, SETTINGS, "plugged=", ORIGIN),
        (Evaluate(BIRTH, ROBOT, 1, 300), EVALUATION, "plugged=", ORIGIN),
        # Noise depends on the requesting island.
        (
            Evaluate(BirthId(3, 9), ROBOT, trial=4, requester=2),
            EVALUATION,
            "plugged=",
            replace(ORIGIN, island=2),
        ),
    ],
)
def test_a_request_carries_the_run_the_work_and_all_that_it_depends_on(
    work: Breed | Evaluate, settings: bytes, plugins: str, origin: Origin
) -> None:
    sent_requests = SentRequests(EVALUATION)
    sent_requests.requests.send(work)
    ((number, agent, payload),) = sent_requests.sent
    assert agent == ("judge" if isinstance(work, Breed) else "one")
    expected = Request("run", EPOCH, number, work, settings, plugins, origin)
    assert request_of(payload) == expected


def test_both_jobs_of_a_cross_check_have_the_same_noise() -> None:
    sent_requests = SentRequests(checks=Checks(1.0))
    sent_requests.requests.send(Evaluate(BIRTH, ROBOT, trial=1))
    first, second = (request_of(payload) for _, _, payload in sent_requests.sent)
    assert first.number != second.number
    assert replace(first, number=second.number) == second


SIGNED = Provenance("one", "platform-one", 0.5)
CLAIM = f"{QUARANTINED}ended its own process 3 times, by SIGSEGV"
TEXT = "\x1b[2Jgone\r\nsecond\u202e line" + "x" * (ANSWER_BYTES - 200)
LINE = "?[2Jgone second? line".ljust(LONGEST_REASON - 3, "x") + "..."


@pytest.mark.parametrize(
    ("ask", "result", "event"),
    [
        (EVALUATE, JUDGED, Evaluated(BIRTH, JUDGED, SIGNED)),
        (EVALUATE, Failure("fell"), EvaluationFailed(BIRTH, "fell", SIGNED)),
        (EVALUATE, Failure(TEXT), EvaluationFailed(BIRTH, LINE, SIGNED)),
        # Only the coordinator knows of a quarantine.
        (EVALUATE, Failure(CLAIM), EvaluationFailed(BIRTH, f"failed: {CLAIM}", SIGNED)),
        (BREED, CHILD, CHILD),
        (BREED, failed(BREED), failed(BREED)),
        (BREED, failed(BREED, TEXT), failed(BREED, LINE)),
    ],
)
def test_an_answer_gives_an_event(
    sent_requests: SentRequests, ask: Breed | Evaluate, result: Result, event: object
) -> None:
    sent_requests.requests.send(ask)
    assert sent_requests.tell(sent_requests.reply(result)) == [event]


@ASKED
def test_robot_that_crashes_three_processes_is_quarantined(
    sent_requests: SentRequests, ask: Breed | Evaluate
) -> None:
    kind: AgentKind = "analyzer" if isinstance(ask, Breed) else "worker"
    sent_requests.tell(Joined("third", kind, 1, "p"))
    sent_requests.requests.send(ask)
    for _ in range(3):
        sent_requests.tell(Left(sent_requests.sent[-1][1]))
    killed = [agent for _, agent, _ in sent_requests.sent]
    number, _, payload = sent_requests.sent[-1]
    told = [
        sent_requests.tell(
            Crash(
                RunningJob(each, "run", EPOCH, number, fingerprint(payload)), "SIGSEGV"
            )
        )
        for each in killed
    ]
    assert told[:-1] == [[], []]
    why = "ended its own process 3 times, by SIGSEGV"
    signed = Provenance(killed[-1])
    assert told[-1] == [
        failed(BREED, f"the analyzer {why}")
        if isinstance(ask, Breed)
        else EvaluationFailed(BIRTH, f"{QUARANTINED}{why}", signed)
    ]


EVALUATIONS: dict[str, Result] = {
    "fitness not a number": replace(JUDGED, fitness=math.nan),
    "infinite velocity": replace(JUDGED, path_velocity=math.inf),
    "a measure that is not asked for": replace(JUDGED, measures=(1.0,)),
    "a child": CHILD,
    "the result of another kind of job": StateMissing(),
}


def child(**changes: object) -> Bred:
    """Return the outcome with other fields of the newborn."""
    assert CHILD.child is not None
    return replace(CHILD, child=replace(CHILD.child, **changes))


def brain(weight: float) -> Robot:
    """Return the child's robot with another weight, or one to nowhere."""
    assert CHILD.child is not None
    robot = CHILD.child.robot
    target = 0 if math.isfinite(weight) else 9999
    edges = (*robot.brain.connections, Connection(0, target, 0.5))
    return replace(robot, brain=replace(robot.brain, connections=edges))


def parts(*kinds: str) -> Robot:
    """Return a robot without a brain."""
    more = (Part(each, at, 1, 0, 0, GREY) for at, each in enumerate(kinds))
    return Robot((Part("Core", -1, -1, -1, 0, GREY), *more))


GREY = (0.5, 0.5, 0.5)
LIES: dict[str, Result] = {
    "birth of another request": replace(CHILD, birth=BirthId(0, 8)),
    "other attempts": replace(CHILD, attempt=0),
    "too many attempts": replace(CHILD, reasons=("crowded",) * 5),
    "no child in too many attempts": replace(failed(BREED), reasons=("x",) * 6),
    "no child in too few attempts": replace(failed(BREED), reasons=("x",) * 4),
    "too few parts": child(robot=parts("FixedBrick")),
    "too many parts": child(robot=parts(*["FixedBrick"] * 30)),
    "unknown part": child(robot=parts("FixedBrick", "Wheel")),
    "parts in a circle": child(robot=Robot(parts("FixedBrick").parts[1:])),
    "connection to an input": child(robot=brain(1.0)),
    "connection to nowhere": child(robot=brain(math.inf)),
    "no genome": child(genome=b"\xff"),
    "genome of another body": child(genome=encode_genome(Node("Core", -1, 0, GREY))),
    "an evaluation": JUDGED,
}


def check_refused(
    sent_requests: SentRequests, ask: Breed | Evaluate, lie: Returned
) -> None:
    """Fail unless a lie is counted, its agent backs off, and another gets the job."""
    liar, honest = lie.agent, {"one": "two", "judge": "juror"}[lie.agent]
    assert sent_requests.tell(lie) == []
    assert sent_requests.fleet.faults.total("malformed") == 1
    assert [agent for _, agent, _ in sent_requests.sent] == [liar, honest]
    result = CHILD if isinstance(ask, Breed) else JUDGED
    (event,) = sent_requests.tell(sent_requests.reply(result))
    assert isinstance(event, Bred | Evaluated)
    # A new job goes to the honest agent, although the other one is idle, too.
    sent_requests.requests.send(ask)
    assert sent_requests.sent[-1][1] == honest
    sent_requests.tell(sent_requests.reply(result))
    sent_requests.wait(10.0)
    sent_requests.requests.send(ask)
    assert sent_requests.sent[-1][1] == liar


@pytest.mark.parametrize(
    ("ask", "lie"),
    [
        *((EVALUATE, lie) for lie in EVALUATIONS.values()),
        *((BREED, lie) for lie in LIES.values()),
    ],
    ids=[*EVALUATIONS, *LIES],
)
def test_false_result_is_refused(
    sent_requests: SentRequests, ask: Breed | Evaluate, lie: Result
) -> None:
    sent_requests.requests.send(ask)
    check_refused(sent_requests, ask, sent_requests.reply(lie))


@pytest.mark.parametrize("own", [Failure("no robot"), CHILD])
def test_a_failure_ends_the_run_if_this_process_fails_too(own: Failure | Bred) -> None:
    sent_requests = SentRequests(checks=Checks(breed=lambda _: own))
    sent_requests.requests.send(BREED)
    told = sent_requests.reply(Failure("no robot"))
    if own != CHILD:
        with pytest.raises(ExperimentError, match="no robot"):
            sent_requests.tell(told)
        return
    assert sent_requests.tell(told) == []
    assert sent_requests.fleet.faults.total("malformed") == 1
    assert sent_requests.sent[-1][1] == "juror"
    assert sent_requests.tell(sent_requests.reply(CHILD)) == [CHILD]


@pytest.mark.parametrize("share", [0.0, 1.0])
def test_only_an_audit_finds_a_child_that_is_not_of_its_parents(share: float) -> None:
    def again(request: Request) -> Bred:
        assert isinstance(request.work, Breed)
        assert (request.settings, request.origin) == (SETTINGS, ORIGIN)
        return CHILD

    sent_requests = SentRequests(checks=Checks(share, breed=again))
    sent_requests.requests.send(BREED)
    lie = replace(bred(ISLAND, replace(BREED, birth=BirthId(0, 8))), birth=BIRTH)
    events = sent_requests.tell(sent_requests.reply(lie))
    if not share:
        assert events == [lie]
        return
    assert events == []
    ((fault, peer, _),) = map(astuple, sent_requests.fleet.faults.counts)
    assert (fault, peer) == ("malformed", "judge")
    assert sent_requests.sent[-1][1] == "juror"
    assert sent_requests.tell(sent_requests.reply(CHILD)) == [CHILD]


@ASKED
@pytest.mark.parametrize(
    ("changes", "kind"),
    [
        ({"epoch": EPOCH + 1}, "stale"),
        ({"number": 77}, "stale"),
        ({"wall_s": -0.1}, "malformed"),
        ({"wall_s": math.inf}, "malformed"),
        ({"wall_s": 1e10}, "malformed"),
        # Thirteen of them filled a journal.
        ({"result": Failure("x" * 30_000_000)}, "too large"),
        ({"result": StateMissing()}, "impossible"),
    ],
)
def test_an_answer_of_no_such_job_is_refused(
    sent_requests: SentRequests,
    ask: Breed | Evaluate,
    changes: dict[str, object],
    kind: str,
) -> None:
    sent_requests.requests.send(ask)
    result = CHILD if isinstance(ask, Breed) else JUDGED
    lie = sent_requests.reply(result, **changes)
    job = sent_requests.fleet.dispatch.job(lie.number)
    assert job is not None
    with pytest.raises(MalformedMessage) as raised:
        job.read(lie.answer)
    assert raised.value.kind == kind
    check_refused(sent_requests, ask, lie)


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


@pytest.mark.parametrize(
    ("shape", "kind", "size", "measures"),
    [((2, 3), "<f8", 48, 1), ((2, 3), "<f8", 40, 0), ((2, 3), "<f8", 48, 0),
     ((2, 3), "|b1", 48, 1), ((2**62, 4), "<f8", 48, 1)],
)  # fmt: skip
def test_traced_evaluation_has_arrays_of_their_shapes(
    shape: tuple[int, ...], kind: Literal["<f8", "|b1"], size: int, measures: int
) -> None:
    packed = PackedTrace(0.2, Array(shape, kind, bytes(size)), {}, {"light": None})
    traced = Traced(replace(JUDGED, measures=(1.0,) * measures), packed)
    data = encode(Answer(1, 2, 0.0, traced))
    read = partial(read_evaluation, expected=(1, 2), measures=1)
    with pytest.raises(MalformedMessage, match="Traced, which is no result"):
        read(data)
    if (size, kind, measures) == (48, "<f8", 1) and shape == (2, 3):
        assert read(data, is_traced=True).result == traced
        return
    with pytest.raises(MalformedMessage, match=r"bytes, got|measures: must be"):
        read(data, is_traced=True)


def test_job_that_several_agents_refuse_stops_the_run(
    sent_requests: SentRequests,
) -> None:
    sent_requests.tell(Joined("three", "worker", 1, ""))
    sent_requests.requests.send(EVALUATE)
    for _ in range(2):
        number, agent, _ = sent_requests.sent[-1]
        refusal = Returned(number, agent, "error", reason="no such plug-in")
        assert sent_requests.tell(refusal) == []
    number, agent, _ = sent_requests.sent[-1]
    with pytest.raises(JobRefused, match=r"birth 7.*cannot evaluate.*no such plug-in"):
        sent_requests.tell(Returned(number, agent, "error", reason="no such plug-in"))
