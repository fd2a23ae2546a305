"""Requests about single robots: results of valid and invalid answers."""

from collections.abc import Callable

import pytest
from msgspec.structs import replace

from coordinator.dispatch.events import (
    AgentKind,
    Joined,
    Left,
    Returned,
)
from coordinator.islands.events import (
    QUARANTINED,
    Evaluated,
    EvaluationFailed,
    Vetted,
    VettingFailed,
)
from schema.errors import JobRefused
from schema.experiment.identity import NO_ORIGIN
from schema.robot.ids import BirthId
from schema.robot.results import Provenance
from schema.wire.codec import fingerprint
from schema.wire.messages import Crash, Evaluate, RunningJob, Vet
from tests.coordinator.sent_requests import (
    BIRTH,
    EPOCH,
    JUDGED,
    ORIGIN,
    ROBOT,
    VIABLE,
    SentRequests,
    request_of,
)


@pytest.fixture
def sent_requests() -> SentRequests:
    return SentRequests()


def test_a_request_carries_the_run_its_settings_and_the_work(
    sent_requests: SentRequests,
) -> None:
    works: tuple[Vet | Evaluate, ...] = (
        Vet(BIRTH, 2, ROBOT),
        Evaluate(BIRTH, ROBOT, 1, 300),
    )
    for work in works:
        sent_requests.requests.send(work)
    agents = [agent for _, agent, _ in sent_requests.sent]
    assert agents == ["judge", "one"]
    for (number, _, payload), work, settings in zip(
        sent_requests.sent, works, (b'"vetting"', b'"evaluation"'), strict=True
    ):
        asked = request_of(payload)
        assert (asked.run, asked.epoch, asked.number) == ("run", EPOCH, number)
        assert (asked.work, asked.settings) == (work, settings)


def test_noise_depends_on_the_requesting_island(sent_requests: SentRequests) -> None:
    for work in (
        Evaluate(BIRTH, ROBOT),
        Evaluate(BirthId(3, 9), ROBOT, trial=4, requester=2),
        Vet(BIRTH, 1, ROBOT),
    ):
        sent_requests.requests.send(work)
    origins = [request_of(payload).origin for _, _, payload in sent_requests.sent]
    assert origins == [ORIGIN, replace(ORIGIN, island=2), NO_ORIGIN]


def test_both_jobs_of_a_cross_check_have_the_same_noise() -> None:
    sent_requests = SentRequests(audit=1.0)
    sent_requests.requests.send(Evaluate(BIRTH, ROBOT, trial=1))
    first, second = (request_of(payload) for _, _, payload in sent_requests.sent)
    assert first.number != second.number
    assert replace(first, number=second.number) == second


def test_evaluation_names_its_worker_and_platform(sent_requests: SentRequests) -> None:
    sent_requests.requests.send(Evaluate(BIRTH, ROBOT))
    (event,) = sent_requests.tell(sent_requests.reply(JUDGED))
    assert isinstance(event, Evaluated)
    assert (event.birth, event.evaluation) == (BIRTH, JUDGED)
    assert event.provenance.agent == "one"
    assert event.provenance.platform == "platform-one"
    assert event.provenance.wall_s == 0.5


def test_request_names_its_plugins_with_their_digests() -> None:
    sent_requests = SentRequests(
        b'{"fitness":{"function":"plugged:speed"},"space":["schema.parts:CORE"]}'
    )
    sent_requests.requests.send(Evaluate(BIRTH, ROBOT))
    assert request_of(sent_requests.sent[0][2]).plugins == "plugged="  # it is not here


@pytest.mark.parametrize("kind", ["evaluate", "vet"])
def test_robot_that_crashes_three_processes_is_quarantined(
    sent_requests: SentRequests, kind: str
) -> None:
    ask = Vet(BIRTH, 2, ROBOT) if kind == "vet" else Evaluate(BIRTH, ROBOT)
    sent_requests.requests.send(ask)
    (number, first, _) = sent_requests.sent[0]
    # Three processes lose it; another one still has it.
    role: AgentKind = "analyzer" if kind == "vet" else "worker"
    sent_requests.tell(Left(first))
    for name in ("b", "c", "d"):
        sent_requests.tell(Joined(name, role, 1, "p"))
        if name != "d":
            sent_requests.tell(Left(sent_requests.sent[-1][1]))
    killed = [agent for _, agent, _ in sent_requests.sent[:3]]
    _, agent, payload = sent_requests.sent[3]
    same = fingerprint(payload)
    of_others = [Crash(RunningJob(killed[0], "another", EPOCH, number, same), "SIGBUS")]
    of_others += [
        Crash(RunningJob(killed[0], "run", EPOCH - 1, number, same), "SIGBUS")
    ]
    own = [
        Crash(RunningJob(each, "run", EPOCH, number, same), "SIGSEGV")
        for each in killed
    ]
    told = [sent_requests.tell(event) for event in (*of_others, *own)]
    assert told[:-1] == [[]] * 4
    ((event,),) = told[-1:]
    why = "ended its own process 3 times, by SIGSEGV"
    if kind == "vet":
        assert event == VettingFailed(BIRTH, 2, f"the analyzer {why}")
    else:
        signed = Provenance(killed[-1])
        assert event == EvaluationFailed(BIRTH, f"{QUARANTINED}{why}", signed)
    assert sent_requests.cancelled == [(agent, payload)]
    assert sent_requests.tell(sent_requests.reply(JUDGED)) == []


def test_a_failed_simulation_is_a_result(sent_requests: SentRequests) -> None:
    sent_requests.requests.send(Evaluate(BIRTH, ROBOT))
    (event,) = sent_requests.tell(sent_requests.reply("diverged"))
    assert isinstance(event, EvaluationFailed)
    assert event.reason == "diverged"


def test_a_worker_cannot_report_a_quarantine(sent_requests: SentRequests) -> None:
    sent_requests.requests.send(Evaluate(BIRTH, ROBOT))
    told = f"{QUARANTINED}ended its own process 3 times, by SIGSEGV"
    (event,) = sent_requests.tell(sent_requests.reply(told))
    assert isinstance(event, EvaluationFailed)
    assert event.reason == f"failed: {told}"
    assert not event.is_quarantined


def test_vetting_gives_a_report_or_a_failed_attempt(
    sent_requests: SentRequests,
) -> None:
    sent_requests.requests.send(Vet(BIRTH, 4, ROBOT))
    assert sent_requests.tell(sent_requests.reply(VIABLE)) == [Vetted(BIRTH, 4, VIABLE)]
    sent_requests.requests.send(Vet(BIRTH, 5, ROBOT))
    failed = VettingFailed(BIRTH, 5, "no box")
    assert sent_requests.tell(sent_requests.reply("no box")) == [failed]


def test_second_answers_and_unknown_answers_change_nothing(
    sent_requests: SentRequests,
) -> None:
    sent_requests.requests.send(Evaluate(BIRTH, ROBOT))
    reply = sent_requests.reply(JUDGED)
    assert len(sent_requests.tell(reply)) == 1
    assert sent_requests.tell(reply) == []
    assert sent_requests.tell(Returned(99, "one", "ok", b"")) == []


@pytest.mark.parametrize(
    "spoil",
    [
        lambda sent_requests: sent_requests.reply(JUDGED, epoch=EPOCH - 1),
        lambda sent_requests: sent_requests.reply(JUDGED, number=41),
        lambda sent_requests: sent_requests.reply(VIABLE),
        lambda sent_requests: Returned(
            sent_requests.sent[-1][0], sent_requests.sent[-1][1], "ok", b"\xff"
        ),
    ],
    ids=["other epoch", "other job", "a verdict", "no message"],
)
def test_malformed_answer_is_counted_and_the_job_goes_to_another_agent(
    sent_requests: SentRequests, spoil: Callable[[SentRequests], Returned]
) -> None:
    sent_requests.requests.send(Evaluate(BIRTH, ROBOT))
    assert sent_requests.tell(spoil(sent_requests)) == []
    assert sent_requests.fleet.faults.total("malformed") == 1
    assert [agent for _, agent, _ in sent_requests.sent] == ["one", "two"]
    (event,) = sent_requests.tell(sent_requests.reply(JUDGED))
    assert isinstance(event, Evaluated)


def test_lost_job_goes_to_another_agent(sent_requests: SentRequests) -> None:
    sent_requests.requests.send(Evaluate(BIRTH, ROBOT))
    assert sent_requests.tell(Left("one")) == []
    assert [agent for _, agent, _ in sent_requests.sent] == ["one", "two"]


def test_job_that_several_agents_refuse_stops_the_run(
    sent_requests: SentRequests,
) -> None:
    sent_requests.tell(Joined("three", "worker", 1, ""))
    sent_requests.requests.send(Evaluate(BIRTH, ROBOT))
    for _ in range(2):
        number, agent, _ = sent_requests.sent[-1]
        refusal = Returned(number, agent, "error", reason="no such plug-in")
        assert sent_requests.tell(refusal) == []
    number, agent, _ = sent_requests.sent[-1]
    with pytest.raises(JobRefused, match=r"birth 7.*cannot evaluate.*no such plug-in"):
        sent_requests.tell(Returned(number, agent, "error", reason="no such plug-in"))
    assert sorted(agent for _, agent, _ in sent_requests.sent) == [
        "one",
        "three",
        "two",
    ]
