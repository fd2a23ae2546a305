"""One fleet for several runs: whose an answer is, and who hears of it."""

import pytest

from coordinator.dispatch.events import (
    AssignShard,
    Deliver,
    Died,
    DispatchEvent,
    Job,
    Joined,
    Left,
    Returned,
    ShardDone,
    ShardFailed,
    ShardReturned,
)
from coordinator.dispatch.fleet import Fleet
from schema.robot.ids import BirthId


class JobClient:
    """Keeps what it is told."""

    def __init__(self, run: str = "run") -> None:
        self.run = run
        self.ends: list[Deliver] = []

    def is_of(self, run: str, epoch: int) -> bool:
        return (run, epoch) == (self.run, 1)

    def checked(self, event: Returned) -> Returned:
        return event

    def deliver(self, command: Deliver) -> None:
        self.ends.append(command)


class ShardClient:
    """Has one arena."""

    def __init__(self) -> None:
        self.ends: list[ShardDone | ShardFailed] = []

    def is_of(self, run: str, epoch: int) -> bool:
        return (run, epoch) == ("arena", 1)

    def payload(self, command: AssignShard) -> bytes:
        return f"whole {command.is_whole}".encode()

    def understood(self, event: Returned) -> ShardReturned:
        return ShardReturned(event.number, "done" if event.outcome == "ok" else "lost")

    def settle(self, command: ShardDone | ShardFailed) -> None:
        self.ends.append(command)


class Agents:
    """Two workers that answer when told to."""

    def __init__(self) -> None:
        self.sent: list[tuple[int, str, bytes]] = []
        self.cancelled: list[tuple[str, bytes]] = []
        self.pauses_s: list[float] = []
        self.news: list[DispatchEvent] = [
            Joined("one", "worker", 1, "p"),
            Joined("two", "worker", 2, "p"),
        ]

    def send(self, number: int, agent: str, payload: bytes) -> None:
        self.sent.append((number, agent, payload))

    def cancel(self, agent: str, payload: bytes, /) -> None:
        self.cancelled.append((agent, payload))

    def receive(
        self, _timeout_s: float, pause_s: float = 0.0, /
    ) -> list[DispatchEvent]:
        self.pauses_s.append(pause_s)
        news, self.news = self.news, []
        return news


@pytest.fixture
def agents() -> Agents:
    return Agents()


@pytest.fixture
def fleet(agents: Agents) -> Fleet:
    made = Fleet(agents)
    assert made.listen(0.0, 0.0) == []
    return made


def ask(fleet: Fleet, requester: JobClient) -> int:
    number = fleet.new_number()
    fleet.ask(Job(number, "evaluate", BirthId(0, number), 0, b""), requester)
    return number


def test_an_answer_goes_to_who_asked(fleet: Fleet, agents: Agents) -> None:
    first, second = JobClient(), JobClient()
    numbers = [ask(fleet, requester) for requester in (first, second, first)]
    assert fleet.open == 3
    agents.news = [Returned(n, agent, "ok", b"x") for n, agent, _ in agents.sent[:2]]
    assert fleet.listen(0.0, 1.0) == [first, second]
    assert [end.job.number for end in (*first.ends, *second.ends)] == numbers[:2]
    assert fleet.open == 1
    assert fleet.listen(0.0, 2.0) == []


def test_credits_are_those_of_the_workers_that_are_there(fleet: Fleet) -> None:
    assert fleet.credits == 5
    fleet.tell(Joined("judge", "analyzer", 4, "p"))
    fleet.tell(Left("two"))
    assert fleet.credits == 2


def test_nobody_hears_of_jobs_of_one_that_left(fleet: Fleet, agents: Agents) -> None:
    requester = JobClient()
    ask(fleet, requester)
    fleet.leave(requester)
    assert fleet.open == 0
    number, agent, payload = agents.sent[0]
    assert agents.cancelled == [(agent, payload)]
    agents.news = [Returned(number, agent, "ok", b"x")]
    assert fleet.listen(0.0, 1.0) == []
    assert requester.ends == []
    # And its worker is free for others.
    others = JobClient()
    for _ in range(5):
        ask(fleet, others)
    assert len(agents.sent) == 6


def test_a_deadly_job_of_one_that_left_kills_nobody_more(
    fleet: Fleet, agents: Agents
) -> None:
    requester, others = JobClient(), JobClient()
    ask(fleet, requester)
    waiting = [
        ask(fleet, each) for each in (requester, others, others, others, requester)
    ][-1]
    assert waiting not in [number for number, _, _ in agents.sent]
    fleet.leave(requester)
    (number, agent, _), *rest = agents.sent
    fleet.tell(Left(agent))
    fleet.tell(Died("run", 1, number, agent, "SIGSEGV"))
    fleet.tell(Joined("three", "worker", 9, "p"))
    again = [each for each, _, _ in agents.sent[1 + len(rest) :]]
    assert number not in again
    assert waiting not in again
    assert fleet.dispatch.pending == 3


def test_deaths_by_jobs_of_other_coordinators_are_not_ours(
    fleet: Fleet, agents: Agents
) -> None:
    requester = JobClient()
    number = ask(fleet, requester)
    for name in ("x", "y", "z"):
        fleet.tell(Died("another run", 1, number, name, "SIGSEGV"))
    assert requester.ends == []
    for name in ("x", "y", "z"):
        fleet.tell(Died("run", 1, number, name, "SIGSEGV"))
    assert [end.is_deadly for end in requester.ends] == [True]
    assert fleet.listen(0.0, 1.0) == [requester]
    assert agents.sent


def test_arenas_of_all_runs_share_the_workers(fleet: Fleet, agents: Agents) -> None:
    owners = [ShardClient(), ShardClient()]
    shards = [fleet.new_shard(owner) for owner in owners]
    for shard in shards:
        fleet.advance(shard)
    assert sorted(agent for _, agent, _ in agents.sent) == ["one", "two"]
    assert fleet.open == 2
    number, agent, payload = agents.sent[1]
    assert payload == b"whole True"
    agents.news = [Returned(number, agent, "ok", b"")]
    assert fleet.listen(0.0, 1.0) == [owners[1]]
    assert owners[1].ends == [ShardDone(shards[1], agent)]
    assert fleet.open == 1


def test_a_released_arena_leaves_room_for_another(fleet: Fleet, agents: Agents) -> None:
    busy, gone = fleet.new_shard(ShardClient()), fleet.new_shard(ShardClient())
    fleet.advance(busy)
    fleet.advance(gone)
    freed = agents.sent[1][1]
    fleet.release(gone)
    assert fleet.open == 1
    fleet.advance(fleet.new_shard(ShardClient()))
    assert agents.sent[2][1] == freed
    # What the released one had out comes back to nobody.
    agents.news = [Returned(agents.sent[1][0], freed, "ok", b"")]
    assert fleet.listen(0.0, 1.0) == []


def test_it_pauses_while_all_workers_have_more_than_enough(
    fleet: Fleet, agents: Agents
) -> None:
    requester = JobClient()
    numbers = [ask(fleet, requester) for _ in range(200)]
    fleet.listen(0.2, 0.0)
    assert agents.pauses_s[-1] == 0.0  # how long a job takes is not known yet
    agents.news = [
        Returned(number, agent, "ok", b"x")
        for number, agent in zip(numbers, ("one", "two"), strict=False)
    ]
    fleet.listen(0.2, 0.02)
    fleet.listen(0.2, 0.03)
    # The first to be done is the one with two slots: sixteen to spare are eight jobs
    # of 20 ms in each; it pauses for half of that.
    assert agents.pauses_s[-1] == pytest.approx(0.08)
    fleet.listen(0.01, 0.04)
    assert agents.pauses_s[-1] == 0.01  # no longer than whoever asked wants to wait
    fleet.advance(fleet.new_shard(ShardClient()))
    fleet.listen(0.2, 0.05)
    assert agents.pauses_s[-1] == 0.0  # an arena waits for each answer
