"""One fleet for several runs: answers are routed to the clients of their jobs."""

import pytest

from coordinator.dispatch.events import (
    Assign,
    Client,
    Deliver,
    Job,
    Joined,
    Left,
    Outcome,
    Read,
    Returned,
    Ticked,
)
from coordinator.dispatch.fleet import JobRouter
from coordinator.dispatch.pool import FIRST_S, LONGEST_WAIT_S, REPLY_S
from schema.errors import MalformedMessage, RunFolderError
from schema.wire.codec import fingerprint
from schema.wire.messages import Crash, RunningJob
from tests.coordinator.sent_requests import SentJobs

CLIENT, OTHER, ARENA = Client("run", 1), Client("other", 1), Client("arena", 1)


def read(data: bytes) -> object:
    """Decode the answer to an advance; "stateless" says that the state is missing."""
    if data == b"bad":
        raise MalformedMessage("bad bytes")
    return None if data == b"stateless" else data


def encode(command: Assign) -> tuple[bytes, Read]:
    return f"whole {command.is_whole}".encode(), read


WORKERS = (Joined("one", "worker", 1, "p"), Joined("two", "worker", 2, "p"))


@pytest.fixture
def agents() -> SentJobs:
    return SentJobs(*WORKERS)


@pytest.fixture
def fleet(agents: SentJobs) -> JobRouter:
    made = JobRouter(agents)
    assert made.listen(0.0, 0.0) == {}
    return made


def request(fleet: JobRouter, client: Client = CLIENT) -> int:
    number = fleet.new_number()
    fleet.request(Job(number, "evaluate", b"", client=client))
    return number


def new_shard(fleet: JobRouter, client: Client = ARENA) -> int:
    return fleet.new_shard(client, encode, "")


def ended(end: Deliver) -> tuple[int, str, object, str]:
    return end.job.shard, end.agent, end.answer, end.reason


def begin(fleet: JobRouter, *, is_arena: bool) -> Client:
    """Request a job, or an advance; return its client."""
    if is_arena:
        fleet.advance(new_shard(fleet))
    else:
        request(fleet)
    return ARENA if is_arena else CLIENT


ALIKE = pytest.mark.parametrize("is_arena", [False, True])


def test_an_answer_goes_to_its_client(fleet: JobRouter, agents: SentJobs) -> None:
    numbers = [request(fleet, client) for client in (CLIENT, OTHER)]
    shard = new_shard(fleet)
    fleet.advance(shard)
    assert fleet.dispatch.pending == 3
    agents.news = [Returned(n, agent, "ok", b"x") for n, agent, _ in agents.sent[1:]]
    ends = fleet.listen(0.0, 1.0)
    assert list(ends) == [OTHER, ARENA]
    assert ends[OTHER][0].job.number == numbers[1]
    assert ended(*ends[ARENA]) == (shard, agents.sent[2][1], b"x", "")
    assert fleet.dispatch.pending == 1
    assert fleet.listen(0.0, 2.0) == {}


def test_credits_count_the_workers_that_joined(fleet: JobRouter) -> None:
    assert fleet.dispatch.credits == 5
    fleet.tell(Joined("judge", "analyzer", 4, "p"))
    fleet.tell(Left("two"))
    assert fleet.dispatch.credits == 2


@pytest.mark.parametrize("outcome", ["ok", "expired", "cancelled"])
def test_jobs_of_a_client_that_left_are_withdrawn(
    fleet: JobRouter, agents: SentJobs, outcome: Outcome
) -> None:
    request(fleet)
    fleet.leave(CLIENT)
    assert fleet.dispatch.pending == 0
    ((number, agent, payload),) = agents.sent
    assert agents.cancelled == [(agent, payload)]
    agents.news = [Returned(number, agent, outcome, b"x", took_s=300.0)]
    assert fleet.listen(0.0, 300.0) == {}
    assert [each.kind for each in fleet.faults.counts] == ["late"] * (outcome == "ok")
    # And its worker is free for other clients.
    for _ in range(5):
        request(fleet, OTHER)
    assert len(agents.sent) == 6


@ALIKE
def test_only_crashes_by_its_own_request_count(
    fleet: JobRouter, agents: SentJobs, *, is_arena: bool
) -> None:
    """Not those of other runs and epochs, of other processes, or by other content."""
    client = begin(fleet, is_arena=is_arena)
    own, strange = client.run, fingerprint(b"deadly")
    for name in ("three", "four", "five"):
        number, agent, payload = agents.sent[-1]
        fleet.tell(Joined(name, "worker", 1, "p"))
        fleet.tell(Left(agent))
        same = fingerprint(payload)
        for crashed in (
            RunningJob(agent, "another run", 1, number, same),
            RunningJob(agent, own, 2, number, same),
            RunningJob(f"not {agent}", own, 1, number, same),
            RunningJob(agents.sent[-1][1], own, 1, agents.sent[-1][0], same),
            RunningJob(agent, own, 1, number, strange),
        ):
            fleet.tell(Crash(crashed, "SIGSEGV"))
        assert fleet.listen(0.0, 1.0) == {}
        fleet.tell(Crash(RunningJob(agent, own, 1, number, same), "SIGSEGV"))
    (end,) = fleet.listen(0.0, 1.0)[client]
    assert end.is_deadly
    assert fleet.faults.total("death") == 3 * 3


def test_late_and_second_answers_are_counted_as_late(
    fleet: JobRouter, agents: SentJobs
) -> None:
    number = request(fleet)
    agent = agents.sent[0][1]
    for late in range(3):
        fleet.tell(Returned(number, agent, "ok", b"x"))
        assert fleet.faults.total("late") == late
    fleet.tell(Returned(77, agent, "ok", b"x"))
    fleet.tell(Returned(77, agent, "lost"))
    assert [(count.kind, count.count) for count in fleet.faults.counts] == [("late", 3)]


@ALIKE
@pytest.mark.parametrize("outcome", ["fenced", "cancelled"])
def test_a_job_that_its_agent_declined_is_given_to_another(
    fleet: JobRouter, agents: SentJobs, outcome: Outcome, *, is_arena: bool
) -> None:
    """Nobody's word about epochs ends a job, and it never counts as an error."""
    client = begin(fleet, is_arena=is_arena)
    for now_s in range(1, 7):
        agents.answer(outcome, b"", reason="epoch 9 has begun")
        assert fleet.listen(0.0, 10.0 * now_s) == {}
        fleet.tell(Ticked(10.0 * now_s + 5.0))
    assert len(agents.sent) == 7
    is_fenced = outcome == "fenced"
    assert [each.client for each in fleet.fenced()] == [client] * 6 * is_fenced
    assert fleet.fenced() == []
    assert fleet.faults.total("cancelled") == 6 * (not is_fenced)


def test_a_job_whose_wait_is_over_stays_with_its_worker(
    fleet: JobRouter, agents: SentJobs
) -> None:
    request(fleet)
    shard = new_shard(fleet)
    fleet.advance(shard)
    first = list(agents.sent)
    for wait_s in (300.0, 3000.0):
        agents.news = [
            Returned(number, agent, "expired", took_s=wait_s)
            for number, agent, _ in first
        ]
        assert fleet.listen(0.0, wait_s) == {}
        assert agents.waits_s[-2:] == [10.0 * wait_s] * 2
    assert agents.sent == 3 * first
    agents.news = [Returned(number, agent, "ok", b"x") for number, agent, _ in first]
    (delivered,), (done,) = fleet.listen(0.0, 4000.0).values()
    assert isinstance(delivered, Deliver)
    assert ended(done) == (shard, first[1][1], b"x", "")
    assert (fleet.faults.total("late"), fleet.dispatch.pending) == (0, 0)


def test_a_job_that_was_sent_again_took_all_the_time(
    fleet: JobRouter, agents: SentJobs
) -> None:
    request(fleet)
    agents.answer(took_s=2.0)
    fleet.listen(0.0, 2.0)
    request(fleet)
    agents.answer("expired", b"", took_s=300.0)
    fleet.listen(0.0, 302.0)
    agent = agents.answer(took_s=1.0)
    assert len(fleet.listen(0.0, 303.0)) == 1
    typical_s = 0.9 * 2.0 + 0.1 * 301.0
    assert fleet.dispatch.workers.agents[agent].job_s == pytest.approx(typical_s)
    request(fleet)
    assert agents.waits_s[-1] == pytest.approx(100.0 * typical_s)


def test_advances_after_one_that_expired_wait_longer(
    fleet: JobRouter, agents: SentJobs
) -> None:
    shard = new_shard(fleet)
    for now_s in (10.0, 20.0):
        fleet.advance(shard)
        agents.answer()
        fleet.listen(0.0, now_s)
    fleet.advance(shard)
    number, agent, payload = agents.sent[-1]
    fleet.tell(Ticked(320.0))
    fleet.tell(Returned(number, agent, "expired", took_s=300.0))
    assert agents.sent[-1] == (number, agent, payload)
    # Another worker ends it: nothing is learned from an advance that is rebuilt.
    fleet.tell(Left(agent))
    assert agents.sent[-1][2] == b"whole True"
    agents.answer()
    fleet.listen(0.0, 321.0)
    fleet.advance(shard)
    # The first one holds what is needed to rebuild the state.
    assert agents.waits_s[:3] == [LONGEST_WAIT_S, LONGEST_WAIT_S, 100.0 * 10.0]
    assert agents.waits_s[-1] == pytest.approx(100.0 * (0.9 * 10.0 + 0.1 * 300.0))


def test_a_state_that_cannot_be_read_ends_only_its_own_run(
    fleet: JobRouter, agents: SentJobs
) -> None:
    def unreadable(_command: Assign) -> tuple[bytes, Read]:
        raise RunFolderError("island-0-5.bin: is missing")

    shards = [fleet.new_shard(CLIENT, unreadable, ""), new_shard(fleet)]
    for shard in shards:
        fleet.advance(shard)
    fleet.tell(Left("two"))
    agent = agents.answer()
    ends = fleet.listen(0.0, 1.0)
    assert [ended(end) for end in (*ends[CLIENT], *ends[ARENA])] == [
        (shards[0], "", None, "island-0-5.bin: is missing"),
        (shards[1], agent, b"x", ""),
    ]
    assert fleet.dispatch.pending == 0
    assert not any(a.busy for a in fleet.dispatch.workers.agents.values())


@pytest.mark.parametrize("is_answer", [True, False])
def test_errors_of_several_workers_stop_an_arena_and_unfit_answers_do_not(
    fleet: JobRouter, agents: SentJobs, *, is_answer: bool
) -> None:
    shard = new_shard(fleet)
    fleet.advance(shard)
    tried = []
    for now_s in range(1, 4):
        if is_answer:
            agent = agents.answer(data=b"bad")
        else:
            agent = agents.answer("error", b"", reason="no such plug-in")
        tried.append(agent)
        ends = fleet.listen(0.0, float(10 * now_s))
        assert fleet.faults.total("malformed") == (now_s if is_answer else 0)
        fleet.tell(Ticked(10 * now_s + 5.0))
    assert set(tried) == {"one", "two"}
    if not is_answer:
        assert ended(*ends[ARENA]) == (shard, agent, None, "no such plug-in")
        return
    assert ends == {}
    agent = agents.answer(data=b"answer")
    (end,) = fleet.listen(0.0, 50.0)[ARENA]
    assert ended(end) == (shard, agent, b"answer", "")


def test_an_unfit_worker_gets_jobs_of_other_clients_only(
    fleet: JobRouter, agents: SentJobs
) -> None:
    """Jobs, and an arena, of a client; an agent that joins again is tried again."""
    shard = new_shard(fleet, CLIENT)
    fleet.advance(shard)
    unfit = agents.answer("unfit", b"", reason="has no plug-in 'x'")
    assert fleet.listen(0.0, 1.0) == {}
    (other,) = fleet.dispatch.fit("worker", CLIENT)
    assert (unfit, other) == ("one", "two")
    assert agents.sent[1][1] == other
    assert fleet.faults.total("refused") == 1
    assert fleet.dispatch.unfit() == {"one": "has no plug-in 'x'"}
    for _ in range(4):
        request(fleet, CLIENT)
    assert {agent for _, agent, _ in agents.sent[1:]} == {other}
    request(fleet, OTHER)
    assert agents.sent[-1][1] == unfit
    fleet.tell(Left(other))
    assert fleet.dispatch.homes.waiting == {0: ""}
    assert fleet.dispatch.fit("worker", CLIENT) == set()
    count = len(agents.sent)
    fleet.tell(Left(unfit))
    fleet.tell(Joined(unfit, "worker", 1, "p"))
    assert len(agents.sent) > count + 1
    agents.answer("unfit", b"", reason="has no plug-in 'x'")
    fleet.listen(0.0, 2.0)
    assert agents.sent[-1][1] not in fleet.dispatch.fit("worker", CLIENT)
    fleet.leave(CLIENT)
    assert fleet.dispatch.fit("worker", CLIENT) == {"one"}
    assert fleet.dispatch.unfit() == {}


@pytest.mark.parametrize("is_late", [False, True])
def test_an_unfit_worker_gets_no_copy_of_an_overdue_job(
    fleet: JobRouter, agents: SentJobs, *, is_late: bool
) -> None:
    request(fleet)
    agents.answer("unfit", b"", reason="no plug-in")
    fleet.listen(0.0, 1.0)
    assert agents.sent[1][1] != agents.sent[0][1]
    fleet.tell(Ticked(1.5 if not is_late else 100.0 * FIRST_S))
    assert len(agents.sent) == 2
    agents.answer()
    assert [type(end) for end in fleet.listen(0.0, 1e6)[CLIENT]] == [Deliver]


def test_a_worker_without_the_state_is_given_it(
    fleet: JobRouter, agents: SentJobs
) -> None:
    shard = new_shard(fleet)
    for answers in ([b"answer"], [b"stateless", b"stateless"]):
        fleet.advance(shard)
        for data in answers:
            agents.answer(data=data)
            fleet.listen(0.0, 1.0)
    payloads = [payload for _, _, payload in agents.sent]
    assert payloads == [b"whole True", b"whole False", *[b"whole True"] * 2]
    # Asking again is an error.
    assert [agent for _, agent, _ in agents.sent] == ["one"] * 3 + ["two"]


def test_a_released_arena_leaves_room_for_another(
    fleet: JobRouter, agents: SentJobs
) -> None:
    fleet.advance(new_shard(fleet, ARENA))
    fleet.advance(new_shard(fleet, OTHER))
    number, freed, payload = agents.sent[1]
    fleet.leave(OTHER)
    assert fleet.dispatch.pending == 1
    assert agents.cancelled == [(freed, payload)]
    fleet.advance(new_shard(fleet, CLIENT))
    assert agents.sent[2][1] == freed
    # The answer to the released arena's request is dropped.
    agents.news = [Returned(number, freed, "ok", b"")]
    assert fleet.listen(0.0, 1.0) == {}


def test_fleet_pauses_while_all_workers_have_spare_jobs(
    fleet: JobRouter, agents: SentJobs
) -> None:
    numbers = [request(fleet) for _ in range(200)]
    fleet.listen(0.2, 0.0)
    assert agents.pauses_s[-1] == 0.0  # how long a job takes is not known yet
    agents.news = [
        Returned(number, agent, "ok", b"x")
        for number, agent in zip(numbers, ("one", "two"), strict=False)
    ]
    fleet.listen(0.2, 0.02)
    fleet.listen(0.2, 0.03)
    # The first to be done is the one with two slots: sixteen to spare are eight jobs
    # of 20 ms in each; it pauses for two fifths of that.
    assert agents.pauses_s[-1] == pytest.approx(0.064)
    fleet.listen(0.01, 0.04)
    assert agents.pauses_s[-1] == 0.01  # at most the caller's timeout
    fleet.advance(new_shard(fleet))
    fleet.listen(0.2, 0.05)
    assert agents.pauses_s[-1] == 0.0  # an arena waits for each answer


def test_a_silent_workers_advance_moves_and_its_late_answer_is_dropped(
    agents: SentJobs,
) -> None:
    lines: list[str] = []
    fleet = JobRouter(agents, warn=lines.append)
    fleet.listen(0.0, 0.0)
    fleet.advance(new_shard(fleet))
    ((number, agent, payload),) = agents.sent
    assert agent == "one"
    fleet.tell(Ticked(FIRST_S))
    assert agents.asked == ["one"]
    fleet.tell(Ticked(FIRST_S + REPLY_S))
    assert agents.cancelled == [("one", payload)]
    assert lines == [
        (
            "one has not answered for 65 s and reports no progress: another one takes "
            "its jobs"
        )
    ]
    (moved, other, payload) = agents.sent[1]
    assert (other, payload) == ("two", b"whole True")
    fleet.tell(Returned(number, "one", "ok", b"bad"))
    assert (
        fleet.faults.total("late"),
        fleet.faults.total("malformed"),
        fleet.dispatch.pending,
    ) == (1, 0, 1)
    agents.news = [Returned(moved, "two", "ok", b"x")]
    (end,) = fleet.listen(0.0, 100.0)[ARENA]
    assert ended(end) == (0, "two", b"x", "")


def test_jobs_and_advances_share_one_account_of_load(
    fleet: JobRouter, agents: SentJobs
) -> None:
    fleet.advance(new_shard(fleet))
    assert [agent for _, agent, _ in agents.sent] == ["one"]
    for _ in range(3):
        request(fleet)
    # The advance counts as a job of the first: the second gets more.
    assert [agent for _, agent, _ in agents.sent[1:]] == ["two", "two", "one"]
    # A worker with many arenas has a job at hand nevertheless.
    for _ in range(6):
        fleet.advance(new_shard(fleet))
    fleet.tell(Returned(agents.sent[3][0], "one", "ok", b""))
    before = len(agents.sent)
    for _ in range(2):
        request(fleet)
    assert "one" in {agent for _, agent, _ in agents.sent[before:]}
