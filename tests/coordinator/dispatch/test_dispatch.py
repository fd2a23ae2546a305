"""Dispatch: each job is done once, whatever happens to its agents."""

import dataclasses
import time
from collections.abc import Callable
from itertools import count, pairwise
from random import Random
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from msgspec.structs import replace

from coordinator.dispatch.assignment import BIRTHS_AT_HAND, CALL_S, COPY_GROWTH, LEAST_S
from coordinator.dispatch.dispatch import MAX_DEATHS, MAX_ERRORS, Dispatch
from coordinator.dispatch.events import (
    AgentKind,
    AskProgress,
    Assign,
    Cancel,
    Client,
    ClientEnded,
    Crowded,
    Deliver,
    DispatchCommand,
    DispatchEvent,
    Expired,
    Job,
    JobKind,
    Joined,
    Left,
    Outcome,
    Overdue,
    Progressed,
    Requested,
    Returned,
    ShardSeen,
    Ticked,
    Withdrawn,
)
from coordinator.dispatch.pool import (
    BACKOFF_S,
    FIRST_S,
    LEAST_WAIT_S,
    LONGEST_BACKOFF_S,
    LONGEST_WAIT_S,
    MOST_AHEAD,
    PATIENCE,
    PAUSE_S,
    REPLY_S,
    Pool,
    longer_s,
)
from schema.errors import UnexpectedEvent
from schema.wire.messages import Crash, RunningJob


def job(number: int, kind: JobKind = "evaluate") -> Job:
    return Job(number, kind, b"%d" % number, client=Client("run", 1))


def worker(name: str, slots: int = 1) -> Joined:
    return Joined(name, "worker", slots, "p")


def ok(number: int, agent: str) -> Returned:
    return Returned(number, agent, "ok", b"a%d" % number)


def error(number: int, agent: str) -> Returned:
    return Returned(number, agent, "error", reason=f"{agent} cannot")


def lost(number: int, agent: str) -> Returned:
    return Returned(number, agent, "lost")


def died(number: int, agent: str, cause: str = "SIGSEGV") -> Crash:
    return Crash(RunningJob(agent, "run", 1, number), cause)


def tell(dispatch: Dispatch, *events: DispatchEvent) -> Dispatch:
    for event in events:
        dispatch.handle(event)
    return dispatch


def told(*events: DispatchEvent) -> Dispatch:
    return tell(Dispatch(), *events)


def given_out(commands: list[DispatchCommand]) -> list[tuple[int, str]]:
    return [(c.job.number, c.agent) for c in commands if isinstance(c, Assign)]


def requests(*numbers: int) -> list[Requested]:
    return [Requested(job(number)) for number in numbers]


def test_an_agent_holds_one_job_more_than_it_has_slots() -> None:
    dispatch = told(*requests(0, 1, 2, 3, 4))
    assert given_out(dispatch.handle(worker("w", slots=2))) == [
        (0, "w"),
        (1, "w"),
        (2, "w"),
    ]
    assert dispatch.waiting("worker") == 2
    assert given_out(dispatch.handle(ok(1, "w"))) == [(3, "w")]


def busy_pair(
    *job_s: float,
) -> tuple[Dispatch, list[tuple[int, str]], list[tuple[int, str]]]:
    """Return two workers after one of 30 jobs each, and the commands of each answer.

    Args:
        job_s: durations of the jobs of the first and the second worker, ascending.
    """
    dispatch = told(Ticked(0.0), worker("a"), worker("b"), *requests(*range(30)))
    assert dispatch.waiting("worker") == 26  # how long they take is not known yet
    assert dispatch.pause_s == 0.0
    given = []
    for number, (name, duration_s) in enumerate(zip("ab", job_s, strict=True)):
        dispatch.handle(Ticked(duration_s))
        given.append(given_out(dispatch.handle(ok(number, name))))
    return dispatch, given[0], given[1]


def test_short_jobs_are_given_ahead_while_many_wait() -> None:
    dispatch, first, second = busy_pair(0.04, 0.04)
    # One for the one that is done; then 25 wait, and a quarter of what still waits
    # may be ahead at each: 5 of 20.
    assert first == [(number, "a") for number in range(4, 10)]
    # The same: 4 of 16.
    assert second == [(number, "b") for number in range(10, 15)]
    # Two fifths of what the second has to spare, 4 jobs, take 64 ms.
    assert dispatch.pause_s == pytest.approx(0.064)
    dispatch.handle(Left("a"))
    # The other had 7, and half of what waits may be ahead at the only one: 9 of 18.
    held = dispatch._pools["worker"].agents["b"].held
    assert (len(held), dispatch.waiting("worker")) == (2 + 9, 17)
    assert dispatch.pause_s == pytest.approx(0.144)
    tell(dispatch, *requests(*range(30, 60)))
    assert len(held) == 2 + MOST_AHEAD
    assert dispatch.pause_s == PAUSE_S  # two fifths of 16 jobs take 256 ms
    # Now jobs seem to take long.
    tell(dispatch, Ticked(100.0), ok(next(iter(held)), "b"))
    assert dispatch.pause_s == PAUSE_S


def test_a_pause_does_not_lengthen_the_next_one() -> None:
    dispatch = told(Ticked(0.0), worker("a"), *requests(*range(100)))
    tell(dispatch, Ticked(0.001), ok(0, "a"))
    for turn in range(1, 50):
        # The coordinator looks every 100 ms; the worker took 1 ms for each job.
        dispatch.handle(Ticked(0.1 * turn))
        place = len(dispatch._pools["worker"].agents["a"].held)
        dispatch.handle(replace(ok(turn, "a"), took_s=0.001 * place))
    # Two fifths of what the 16 jobs ahead take.
    assert dispatch.pause_s == pytest.approx(0.0064, rel=0.1)


def test_a_slow_worker_is_given_no_more_ahead_than_it_can_do_soon() -> None:
    dispatch, first, second = busy_pair(0.04, 0.5)
    assert len(first) == 6
    # One in the place of the one that is done, and what takes less than 0.8 s.
    assert second == [(10, "b"), (11, "b")]
    # The quick one, too, is done with 5 x 40 ms, and the slow one with 500 ms.
    assert dispatch.pause_s == pytest.approx(0.08)
    # What the slow one has keeps nothing from the quick one.
    tell(dispatch, *requests(*range(30, 90)))
    agents = dispatch._pools["worker"].agents
    assert {name: len(agent.held) for name, agent in agents.items()} == {
        "a": 2 + MOST_AHEAD,
        "b": 2 + 1,
    }


def test_new_agent_gets_no_jobs_ahead_before_its_first_answer() -> None:
    dispatch, *_ = busy_pair(0.04, 0.04)
    tell(dispatch, worker("c"), *requests(*range(30, 190)))
    agents = dispatch._pools["worker"].agents
    assert [len(agents[name].held) for name in "abc"] == [18, 18, 2]
    assert dispatch.pause_s == 0.0


def test_least_busy_agent_gets_the_job_and_ties_break_on_its_name() -> None:
    dispatch = told(worker("b"), worker("a"), worker("c", slots=4))
    out = [given_out(dispatch.handle(event)) for event in requests(*range(8))]
    # c has four slots: one job there weighs a quarter.
    assert [agent for ((_, agent),) in out] == ["a", "b", "c", "c", "c", "c", "a", "b"]


class Single:
    """A dispatcher of one job or one advance, which has a number each time.

    Attributes:
        assigned: its numbers and agents.
    """

    def __init__(self, shard: int, *names: str) -> None:
        numbers = count(1)
        self.dispatch = Dispatch(numbers)
        self.assigned: list[tuple[int, str]] = []
        self.handle(Ticked(0.0))
        for name in names:
            self.handle(worker(name))
        kind: JobKind = "evaluate" if shard < 0 else "advance"
        if shard >= 0:
            self.handle(ShardSeen(shard, "", client=Client("run", 1)))
        self._job = Job(next(numbers), kind, shard=shard, client=Client("run", 1))
        self.handle(Requested(self._job))

    @property
    def job(self) -> Job:
        return dataclasses.replace(self._job, number=self.assigned[-1][0])

    def handle(self, event: DispatchEvent) -> list[DispatchCommand]:
        commands = self.dispatch.handle(event)
        self.assigned += given_out(commands)
        return commands

    def come_back(self, outcome: Outcome) -> list[DispatchCommand]:
        return self.handle(Returned(*self.assigned[-1], outcome, b"a", outcome))


ALIKE = pytest.mark.parametrize("shard", [-1, 0], ids=["job", "advance"])


@ALIKE
@pytest.mark.parametrize(
    "outcome", ["error", "malformed", "unfit", "lost", "fenced", "cancelled", "left"]
)
def test_a_job_goes_to_another_agent(shard: int, outcome: Any) -> None:  # noqa: ANN401
    single = Single(shard, "a", "b")
    first = single.assigned[0]
    if outcome == "left":
        single.handle(Left("a"))
        single.handle(lost(*first))
    else:
        single.handle(Returned(*first, outcome, reason="why"))
    assert [agent for _, agent in single.assigned] == ["a", "b"]
    assert single.handle(Returned(*first, "ok", b"late")) == []
    assert single.come_back("ok") == [Deliver(single.job, "b", "p", b"a")]


@ALIKE
def test_backoff_grows_until_an_answer_arrives(shard: int) -> None:
    single = Single(shard, "a")
    now_s, backoffs = 0.0, list[float]()
    outcomes: tuple[Outcome, ...] = ("lost", "malformed", "lost")
    for outcome in outcomes * 3:
        assert single.come_back(outcome) == []
        wake_s = single.dispatch.wake_s
        assert wake_s is not None
        assert single.handle(Ticked(now_s + 0.9 * (wake_s - now_s))) == []
        assert len(single.handle(Ticked(wake_s))) == 1
        backoffs.append(wake_s - now_s)
        now_s = wake_s
    doubled = [min(BACKOFF_S * 2**k, LONGEST_BACKOFF_S) for k in range(9)]
    assert backoffs == pytest.approx(doubled)
    single.come_back("ok")
    single.handle(Requested(job(100)))
    single.handle(lost(100, "a"))
    assert single.dispatch.wake_s == pytest.approx(now_s + BACKOFF_S)


def test_failed_job_goes_to_another_agent() -> None:
    dispatch = told(Ticked(0.0), worker("a"), worker("b"), *requests(0, 1, 2, 3))
    # a holds 0 and 2, b holds 1 and 3 and has no credit.
    assert dispatch.handle(error(0, "a")) == []
    assert dispatch.handle(Ticked(9.0)) == []  # a is free again, but 0 avoids it
    assert given_out(dispatch.handle(Requested(job(4)))) == [(4, "a")]
    assert given_out(dispatch.handle(ok(1, "b"))) == [(0, "b")]


@ALIKE
def test_errors_end_a_job_and_nothing_else_does(shard: int) -> None:
    single = Single(shard, "a", "b")
    outcomes: list[Outcome] = ["lost", "malformed", "cancelled"] * 10
    outcomes += ["error"] * (MAX_ERRORS - 1)
    for tick, outcome in enumerate(outcomes, 1):
        commands = single.come_back(outcome)
        commands += single.handle(Ticked(10.0 * tick))
        assert given_out(commands) == single.assigned[tick:]
        assert len(commands) == 1
    agents = [agent for _, agent in single.assigned]
    assert {*agents} == {"a", "b"}
    given_up = Deliver(single.job, agents[-1], reason="error")
    assert single.come_back("error") == [given_up]
    assert single.dispatch.pending == 0


@pytest.mark.parametrize("kind", ["evaluate", "call"])
@pytest.mark.parametrize(
    ("took_s", "wait_s"), [(20.0, 2000.0), (0.01, LEAST_WAIT_S), (1e9, LONGEST_WAIT_S)]
)
def test_the_network_waits_for_a_multiple_of_the_typical_duration(
    kind: JobKind, took_s: float, wait_s: float
) -> None:
    """It holds memory of each request until then, and there may be millions."""
    dispatch = told(Ticked(0.0), worker("a"), Requested(job(0, kind)))
    assert dispatch.wait_s(Assign(job(0, kind), "a")) == LONGEST_WAIT_S
    dispatch.handle(replace(ok(0, "a"), took_s=took_s))
    assert dispatch.wait_s(Assign(job(1, kind), "a")) == pytest.approx(wait_s)
    other: JobKind = "call" if kind == "evaluate" else "evaluate"
    assert dispatch.wait_s(Assign(job(1, other), "a")) == LONGEST_WAIT_S
    assert longer_s(2000.0) == 20_000.0
    assert longer_s(200_000.0) == LONGEST_WAIT_S


def test_nothing_is_learned_from_an_agent_that_is_back_with_the_answer() -> None:
    dispatch = told(Ticked(0.0), worker("a"), *requests(0, 1), Left("a"), worker("a"))
    assert dispatch.handle(replace(ok(0, "a"), took_s=0.001))
    assert dispatch.workers.agents["a"].job_s == 0.0
    assert dispatch.wait_s(Assign(job(2), "a")) == LONGEST_WAIT_S


def test_repeated_events_change_nothing() -> None:
    dispatch = told(worker("a"), *requests(0))
    assert dispatch.handle(worker("a")) == []
    assert dispatch.handle(Requested(job(0))) == []
    assert dispatch.handle(Left("nobody")) == []
    assert (dispatch.pending, dispatch.agents("worker")) == (1, 1)


@pytest.mark.parametrize(
    "event",
    [
        Requested(job(4)),
        Requested(job(5, "breed")),
        worker("b", slots=0),
        worker("a", slots=3),
        Joined("a", "analyzer", 1, "p"),
        Ticked(0.5),
    ],
)
def test_invalid_events_raise_and_change_nothing(event: DispatchEvent) -> None:
    dispatch = told(Ticked(1.0), worker("a"), Requested(job(5)))
    with pytest.raises(UnexpectedEvent):
        dispatch.handle(event)
    assert dispatch.handle(ok(5, "a")) == [Deliver(job(5), "a", "p", b"a5")]
    assert dispatch.pending == 0


def late(typical_s: float = 0.5) -> Dispatch:
    """Return a dispatcher whose worker a is late with job 1 while b is idle."""
    dispatch = told(Ticked(0.0), worker("a"), *requests(0), Ticked(typical_s))
    return tell(dispatch, ok(0, "a"), *requests(1, 2), worker("b"))


@pytest.mark.parametrize(("typical_s", "patience_s"), [(0.01, LEAST_S), (0.5, 2.0)])
def test_late_job_is_duplicated_on_an_idle_agent(
    typical_s: float, patience_s: float
) -> None:
    assert PATIENCE == 4.0
    dispatch = late(typical_s)
    almost_s = typical_s + patience_s
    assert given_out(dispatch.handle(Ticked(almost_s))) == []
    # The oldest first; no agent is idle for the second.
    assert given_out(dispatch.handle(Ticked(almost_s + 0.3))) == [(1, "b")]
    assert given_out(dispatch.handle(Ticked(almost_s + 9.0))) == []


def test_first_answer_counts_and_the_other_copy_is_cancelled() -> None:
    dispatch = tell(late(), Ticked(9.0))
    first = dispatch.handle(ok(1, "b"))
    assert first == [Deliver(job(1), "b", "p", b"a1"), Cancel(job(1), "a")]
    assert given_out(dispatch.handle(Ticked(19.0))) == [(2, "b")]
    # The loser keeps its credit busy until it has answered, too; then it is free.
    assert given_out(dispatch.handle(Requested(job(3)))) == [(3, "b")]
    assert dispatch.handle(Requested(job(4))) == []
    assert given_out(dispatch.handle(error(1, "a"))) == [(4, "a")]
    assert dispatch.wake_s is None


@pytest.mark.parametrize(
    ("who", "job_s"),
    # The first did a job in 0.5 s before and has had this one for 9.5 s; the second
    # has had its copy for 1 s.
    [("a", 0.9 * 0.5 + 0.1 * 9.5), ("b", 1.0)],
)
def test_each_copy_of_a_job_is_timed_from_its_own_assignment(
    who: str, job_s: float
) -> None:
    dispatch = tell(late(), Ticked(9.0), Ticked(10.0), ok(1, who))
    learned = dispatch._pools["worker"].agents[who].job_s
    assert learned == pytest.approx(job_s)


def silent(dispatch: Dispatch, now_s: float) -> list[DispatchCommand]:
    """Let agents be asked from a time on, and not answer; return what follows."""
    asked = dispatch.handle(Ticked(now_s))
    assert {type(command) for command in asked} <= {AskProgress}
    return dispatch.handle(Ticked(now_s + REPLY_S + 0.3))


def test_a_third_copy_needs_a_silent_agent() -> None:
    dispatch = told(Ticked(0.0), worker("a"), *requests(0), worker("b"))
    assert given_out(dispatch.handle(Ticked(FIRST_S + 1.0))) == [(0, "b")]
    tell(dispatch, worker("c"), worker("d"))
    assert dispatch.handle(Ticked(2 * FIRST_S)) == [AskProgress("a")]
    # Both work: the third has no cause to help.
    dispatch.handle(Progressed("a"))
    assert dispatch.handle(Ticked(3 * FIRST_S + 1.0)) == [AskProgress("b")]
    dispatch.handle(Progressed("b"))
    assert given_out(dispatch.handle(Ticked(4 * FIRST_S))) == []
    assert given_out(silent(dispatch, 4 * FIRST_S + 1.0)) == [(0, "c")]
    # The second one does not report any more, either.
    told_s = 5 * FIRST_S + 1.0
    assert dispatch.handle(Ticked(told_s)) == [
        Overdue("a", told_s, "b"),
        AskProgress("a"),
        AskProgress("b"),
    ]
    assert given_out(dispatch.handle(Ticked(told_s + REPLY_S - 0.1))) == []
    assert given_out(dispatch.handle(Ticked(told_s + REPLY_S + 1.0))) == [(0, "d")]


def test_user_is_told_once_of_a_silent_agent_without_a_substitute() -> None:
    dispatch = told(Ticked(0.0), worker("a"), *requests(0, 1))
    assert dispatch.handle(Ticked(FIRST_S)) == []
    assert silent(dispatch, CALL_S) == []
    # At the next look: its reply may have come with the coordinator's own delay.
    assert dispatch.handle(Ticked(130.0)) == [Overdue("a", 130.0)]
    for more in range(1, 9):
        commands = dispatch.handle(Ticked(130.0 + more * FIRST_S))
        assert {type(command) for command in commands} <= {AskProgress}
    # It was only slow; if it falls silent again, the user is told again.
    dispatch.handle(ok(0, "a"))
    silent(dispatch, 9000.0)
    assert dispatch.handle(Ticked(9010.0)) == [Overdue("a", 9010.0)]


def simulation(number: int, simulated_s: float = 12.0, paired: int = -1) -> Job:
    return Job(
        number, "evaluate", b"", paired, Client("run", 1), simulated_s=simulated_s
    )


def vetting(number: int) -> Job:
    return dataclasses.replace(job(number, "breed"), simulated_s=0.0)


class Silence:
    """Silent agents, and an honest one that does a job in 40 ms, by a simulated clock.

    The silent ones joined first, and their names are first.
    """

    def __init__(self, silent: int, make: Callable[[int], Job], window: int) -> None:
        self.dispatch = Dispatch()
        self.now_s = self.free_s = 0.0
        self.answers: list[tuple[float, int]] = []
        self.delivered_s: dict[int, float] = {}
        self.told: list[Overdue] = []
        self.silent = [f"silent-{number}" for number in range(silent)]
        kind: AgentKind = "analyzer" if make(0).kind == "breed" else "worker"
        self.handle(Ticked(0.0))
        for name in (*self.silent, "the honest"):
            self.handle(Joined(name, kind, 1, "p"))
        self.make, self.window, self.begun = make, window, 0

    def handle(self, event: DispatchEvent) -> None:
        for command in self.dispatch.handle(event):
            if isinstance(command, Assign) and command.agent == "the honest":
                self.free_s = max(self.free_s, self.now_s) + 0.04
                self.answers.append((self.free_s, command.job.number))
            elif isinstance(command, Deliver):
                assert command.job.number not in self.delivered_s
                self.delivered_s[command.job.number] = self.now_s
            elif isinstance(command, Overdue):
                self.told.append(command)

    def wait(self, seconds: int) -> None:
        for _ in range(seconds):
            self.now_s += 1.0
            self.handle(Ticked(self.now_s))

    def run(self, jobs: int, tick_s: float = 0.2) -> float:
        """Do jobs, a window of which is open at once; return the longest stall [s]."""
        begin_s = self.now_s
        next_s = begin_s + tick_s
        while len(self.delivered_s) < jobs:
            assert self.now_s < 200.0
            done = next(n for n in range(jobs) if n not in self.delivered_s)
            while self.begun < min(jobs, done + self.window):
                self.handle(Requested(self.make(self.begun)))
                self.begun += 1
            if self.answers and self.answers[0][0] < next_s:
                self.now_s, number = self.answers.pop(0)
                self.handle(ok(number, "the honest"))
            else:
                self.now_s, next_s = next_s, next_s + tick_s
                self.handle(Ticked(self.now_s))
        ended_s = sorted(each for each in self.delivered_s.values() if each > begin_s)
        times_s = [begin_s, *ended_s]
        return max(after - before for before, after in pairwise(times_s))


@pytest.mark.parametrize("window", [1, 15])
@pytest.mark.parametrize("make", [simulation, vetting])
@pytest.mark.parametrize(("silent", "most_s"), [(1, 2.0), (2, 4.0), (4, 8.0)])
def test_each_silent_agent_costs_a_small_delay(
    silent: int, most_s: float, make: Callable[[int], Job], window: int
) -> None:
    for tick_s in (0.2, 0.23):
        world = Silence(silent, make, window)
        assert 0.5 < world.run(40, tick_s) < most_s
        world.wait(20)
        assert {each.agent for each in world.told} == set(world.silent)
        assert all(each.to for each in world.told)
        found = world.dispatch.silent()
        assert set(found) == set(world.silent)
        # They get no more than what an agent holds at first.
        at_hand = 1 + (BIRTHS_AT_HAND if make is vetting else 1)
        assert all(1 <= jobs <= at_hand for jobs in found.values())
        assert world.run(100, tick_s) < 0.3


def test_a_silent_agent_that_is_heard_gets_jobs_again() -> None:
    world = Silence(1, simulation, 15)
    world.run(40)
    world.wait(20)
    (name,) = world.silent
    held = list(world.dispatch.workers.agents[name].held)
    assert given_out(world.dispatch.handle(Requested(simulation(100)))) == [
        (100, "the honest")
    ]
    world.dispatch.handle(ok(held[0], name))
    assert world.dispatch.silent() == {}
    # It has one that others did, the other has one, too, and the names decide.
    assert given_out(world.dispatch.handle(Requested(simulation(101)))) == [(101, name)]


def test_a_job_given_to_a_silent_agent_is_given_to_another_at_once() -> None:
    """Its queries have ended without a reply: it is tried again, and costs nothing."""
    world = Silence(1, simulation, 15)
    world.run(40)
    (name,) = world.silent
    for number in list(world.dispatch.workers.agents[name].held):
        world.dispatch.handle(lost(number, name))
    world.wait(20)
    commands = world.dispatch.handle(Requested(simulation(100)))
    assert sorted(given_out(commands)) == [(100, name), (100, "the honest")]
    delivered = Deliver(simulation(100), name, "p", b"a100")
    assert delivered in world.dispatch.handle(ok(100, name))
    assert world.dispatch.silent() == {}


def test_agents_that_report_progress_and_never_answer_end_no_run() -> None:
    dispatch = told(Ticked(0.0), *(worker(name) for name in "abcd"))
    given = given_out(dispatch.handle(Requested(simulation(0))))
    at_s = [0.0]
    for tick in range(1, 1700):
        for command in dispatch.handle(Ticked(0.2 * tick)):
            if isinstance(command, AskProgress):
                dispatch.handle(Progressed(command.agent))
            else:
                given += given_out([command])
                at_s.append(0.2 * tick)
    assert given == [(0, name) for name in "abcd"]
    waits_s = [after - before for before, after in pairwise(at_s)]
    assert waits_s == pytest.approx([1.2, 1.2 * 16.0, 1.2 * 256.0], abs=0.5)
    assert dispatch.silent() == {}


def test_a_deadline_follows_the_simulated_time() -> None:
    """Jobs that simulate 10 s take 3 s here, those of 100 s take 30 s."""
    dispatch = told(Ticked(0.0), worker("a"), Requested(simulation(0, 10.0)))
    tell(dispatch, Ticked(3.0), ok(0, "a"), Requested(simulation(1, 100.0)))
    dispatch.handle(worker("b"))
    assert dispatch.handle(Ticked(3.0 + 119.0)) == []
    assert given_out(dispatch.handle(Ticked(3.0 + 121.0))) == [(1, "b")]


@pytest.mark.parametrize(
    ("simulated_s", "first_s"), [(0.0, LEAST_S), (30.0, 3.0), (1e9, FIRST_S)]
)
def test_the_first_deadline_is_that_of_a_slow_simulation(
    simulated_s: float, first_s: float
) -> None:
    dispatch = told(Ticked(0.0), worker("a"), Requested(simulation(0, simulated_s)))
    dispatch.handle(worker("b"))
    assert dispatch.handle(Ticked(first_s - 0.1)) == []
    assert (0, "b") in given_out(dispatch.handle(Ticked(first_s + 0.3)))


def test_calls_keep_their_wait() -> None:
    dispatch = told(Ticked(0.0), worker("a"), Requested(job(0, "call")), worker("b"))
    for second in range(60):
        assert dispatch.handle(Ticked(float(second))) == []
    assert given_out(dispatch.handle(Ticked(61.0))) == [(0, "b")]
    assert dispatch.handle(Ticked(119.0)) == []
    assert dispatch.handle(Ticked(121.0)) == [AskProgress("a")]


def test_the_second_of_two_paired_jobs_does_not_wait_for_a_silent_worker() -> None:
    dispatch = told(Ticked(0.0), worker("a"), worker("b"))
    first, second = simulation(0, paired=1), simulation(1, paired=0)
    assert given_out(dispatch.handle(Requested(first))) == [(0, "a")]
    assert given_out(dispatch.handle(Requested(second))) == [(1, "b")]
    tell(dispatch, Ticked(0.04), ok(0, "a"))
    given = [
        each
        for tick in range(1, 20)
        for each in given_out(dispatch.handle(Ticked(0.2 * tick)))
    ]
    assert given == [(1, "a")]


def test_an_unfit_agent_looks_at_each_waiting_job_once(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """As does one that has one of each two paired jobs."""
    looks = 0
    may_take = Pool.may_take

    def counted(pool: Pool, *job: Any) -> bool:  # noqa: ANN401 - as of the method
        nonlocal looks
        looks += 1
        return may_take(pool, *job)

    monkeypatch.setattr(Pool, "may_take", counted)
    dispatch = told(worker("a"), worker("b"), Requested(job(0)))
    dispatch.handle(Returned(0, "a", "unfit", reason="no plug-in"))
    tell(dispatch, *requests(*range(1, 1001)))
    assert dispatch.waiting("worker") == 999
    assert looks < 6 * 1000
    looks = 0
    tell(dispatch, *(ok(number, "b") for number in range(1, 1001)))
    assert dispatch.pending == 1
    dispatch = told(worker("slow", 2), worker("z"))
    for number in range(0, 1000, 2):
        dispatch.handle(Requested(simulation(number, paired=number + 1)))
        dispatch.handle(Requested(simulation(number + 1, paired=number)))
    done = 0
    while dispatch.workers.agents["z"].held:
        dispatch.handle(ok(next(iter(dispatch.workers.agents["z"].held)), "z"))
        done += 1
    assert done > 400
    assert looks < 12 * 1000


def test_many_waiting_jobs_are_withdrawn_in_linear_time() -> None:
    def seconds(clients: int, jobs: int) -> float:
        machines = [told(*requests(*range(jobs))) for _ in range(clients)]
        # A process's CPU clock stands still on a machine whose host takes time away.
        began_s = time.perf_counter()
        for dispatch in machines:
            dispatch.handle(ClientEnded(Client("run", 1)))
        took_s = time.perf_counter() - began_s
        assert all(x.pending == x.waiting("worker") == 0 for x in machines)
        return took_s

    turns = [(seconds(1, 20_000), seconds(40, 500)) for _ in range(3)]
    assert min(one for one, _ in turns) < 5.0 * min(many for _, many in turns)


@ALIKE
def test_job_that_crashed_three_processes_is_given_up(shard: int) -> None:
    single = Single(shard, "a", "b", "c")
    number, _ = single.assigned[0]
    # "a" has the job and is there, the others never had it.
    for name in "abxyz":
        assert single.handle(died(number, name)) == []
    for name in "abc":
        single.handle(Left(name))
    first, second, third = single.assigned
    assert [agent for _, agent in single.assigned] == ["a", "b", "c"]
    single.handle(worker("d"))
    for lost_by in (first, second, first, second):
        assert single.handle(died(*lost_by)) == []
    reason = "ended its own process 3 times, by SIGPROF, SIGSEGV"
    assert single.handle(died(*third, "SIGPROF")) == [
        Deliver(single.job, "c", reason=reason, is_deadly=True),
        Cancel(single.job, "d"),
    ]
    assert single.dispatch.pending == single.dispatch.waiting("worker") == 0
    assert single.handle(died(*third)) == []


def test_paired_jobs_go_to_two_workers_if_there_are_two() -> None:
    first = Job(1, "evaluate", b"1", paired=2)
    second = Job(2, "evaluate", b"2", paired=1)
    dispatch = told(worker("a"))
    assert given_out(dispatch.handle(Requested(first))) == [(1, "a")]
    assert given_out(dispatch.handle(Requested(second))) == [(2, "a")]
    dispatch = told(worker("a"), worker("b", 3), Requested(first))
    assert given_out(dispatch.handle(Requested(second))) == [(2, "b")]
    assert given_out(dispatch.handle(Left("a"))) == [(1, "b")]
    tell(dispatch, worker("c"), ok(1, "b"))
    # c did neither of them yet.
    assert given_out(dispatch.handle(lost(2, "b"))) == [(2, "c")]
    dispatch.handle(ok(2, "c"))
    assert not dispatch._pairs._agents


class World:
    """All events that jobs can meet, and the invariants after each step."""

    def __init__(self, seed: int) -> None:
        self.dispatch = Dispatch()
        self.random = Random(seed)  # noqa: S311 - a story, no secret
        self.names = count()
        self.numbers = count()
        self.now_s = 0.0
        self.jobs: dict[int, Job] = {}
        self.delivered: dict[int, Deliver] = {}
        self.withdrawn: set[int] = set()
        self.errors: dict[int, int] = {}
        self.killed: dict[int, list[str]] = {}
        self.agents: dict[str, Joined] = {}
        self.held: dict[str, list[int]] = {}
        self.past: list[DispatchEvent] = []

    def tell(self, event: DispatchEvent) -> None:
        for command in self.dispatch.handle(event):
            if isinstance(command, AskProgress | Overdue):
                assert command.agent in self.agents
                continue
            assert not isinstance(command, Crowded)
            number, agent = command.job.number, command.agent
            if isinstance(command, Deliver):
                assert number not in {*self.delivered, *self.withdrawn}
                self.delivered[number] = command
                continue
            if isinstance(command, Cancel):
                assert number in {*self.delivered, *self.withdrawn}
                assert number in self.held[agent]
                continue
            assert number not in {*self.delivered, *self.withdrawn}
            silent = self.dispatch.silent()
            working = sum(
                number in held and name not in silent
                for name, held in self.held.items()
            )
            assert working < 2 or self.now_s > COPY_GROWTH * LEAST_S
            assert number not in self.held[agent]
            kind: AgentKind = "analyzer" if command.job.kind == "breed" else "worker"
            assert self.agents[agent].kind == kind
            self.held[agent].append(number)
            at_hand = BIRTHS_AT_HAND if kind == "analyzer" else 1
            most = self.agents[agent].slots + at_hand + MOST_AHEAD
            assert len(self.held[agent]) <= most
        self.past.append(event)
        self.check()

    def check(self) -> None:
        """Compare the dispatcher's records with the model."""
        inside = self.dispatch
        ended = len(self.delivered) + len(self.withdrawn)
        ended_numbers = {*self.delivered, *self.withdrawn}
        assert inside.pending == len(self.jobs) - ended
        for kind, pool in inside._pools.items():
            names = [n for n, joined in self.agents.items() if joined.kind == kind]
            assert sorted(pool.agents) == sorted(names)
            for name in names:
                assert sorted(pool.agents[name].held) == sorted(self.held[name])
            held = [number for name in names for number in self.held[name]]
            assert (inside.agents(kind), inside.names(kind)) == (
                len(names),
                sorted(names),
            )
            assert inside.assigned(kind) == len(held)
            assert inside.waiting(kind) == len(pool.waiting)
            silent = {name for name in names if pool.agents[name].is_silent}
            working = [
                n for name in names for n in self.held[name] if name not in silent
            ]
            assert not set(pool.waiting) & set(working)
            assert set(held) - set(working) - set(pool.waiting) <= ended_numbers
            assert len(pool.free) <= 4 * len(pool.agents) + 65
            if pool.waiting and (name := pool.best()):
                # Credit and work: only a job that avoids all with credit waits.
                assert all(each.avoid for each in pool.waiting.values())

    def request(self) -> None:
        number = next(self.numbers)
        kind: JobKind = self.random.choice(("breed", "evaluate"))
        made = dataclasses.replace(
            job(number, kind), simulated_s=self.random.choice((None, 1.0))
        )
        self.jobs[number] = made
        self.tell(Requested(self.jobs[number]))

    def withdraw(self) -> None:
        """A client withdraws a job that may be waiting, assigned or long done."""
        if self.jobs:
            number = self.random.choice(sorted(self.jobs))
            if number not in self.delivered:
                self.withdrawn.add(number)
            self.tell(Withdrawn(number))

    def join(self) -> None:
        kind: AgentKind = self.random.choice(("worker", "analyzer"))
        name = f"{kind}-{next(self.names)}"
        self.enter(Joined(name, kind, self.random.randint(1, 3), "p"))

    def enter(self, joined: Joined) -> None:
        self.agents[joined.agent] = joined
        self.held[joined.agent] = []
        self.tell(joined)

    def leave(self) -> None:
        if self.agents:
            name = self.random.choice(sorted(self.agents))
            joined = self.agents.pop(name)
            held = self.held.pop(name)
            self.tell(Left(name))
            for number in held:  # the news of each comes after that of the whole
                self.tell(lost(number, name))
            if self.random.random() < 0.3:  # a thawed one comes back
                self.enter(joined)

    def answer(self) -> None:
        self.give_back("ok")

    def give_back(self, outcome: str) -> None:
        busy = sorted(name for name, held in self.held.items() if held)
        if not busy:
            return
        name = self.random.choice(busy)
        held = self.held[name]
        number = held.pop(self.random.randrange(len(held)))
        if outcome == "error" and number not in self.delivered:
            self.errors[number] = self.errors.get(number, 0) + 1
        made = {"ok": ok, "error": error, "lost": lost}[outcome]
        self.tell(made(number, name))

    def fail(self) -> None:
        self.give_back("error")

    def lose(self) -> None:
        self.give_back("lost")

    def expire(self) -> None:
        """A job is sent again to its agent; either may be gone."""
        if self.jobs:
            number = self.random.choice(sorted(self.jobs))
            agent = self.random.choice([*sorted(self.agents), "nobody"])
            self.tell(Expired(number, agent))

    def report(self) -> None:
        """An agent reports progress; it may have left."""
        self.tell(Progressed(self.random.choice([*sorted(self.agents), "nobody"])))

    def die(self) -> None:
        """An agent dies of a job that may be long done."""
        if self.jobs:
            number = self.random.choice(sorted(self.jobs))
            self.killed.setdefault(number, []).append(f"dead-{next(self.names)}")
            self.tell(died(number, self.killed[number][-1]))

    def tick(self) -> None:
        self.now_s += self.random.choice((0.1, 0.3, 3.0, 30.0))
        self.tell(Ticked(self.now_s))

    def repeat(self) -> None:
        """Repeat an earlier message unless its sender is working on a request."""
        event = self.random.choice(self.past) if self.past else Left("nobody")
        if isinstance(event, Returned) and event.number not in self.held.get(
            event.agent, ()
        ):
            self.tell(event)

    def finish(self) -> None:
        """Let one healthy agent of each kind join, and let time pass."""
        self.enter(Joined("z1", "worker", 1, "p"))
        self.enter(Joined("z2", "analyzer", 1, "p"))
        while self.dispatch.pending:
            self.now_s += LONGEST_BACKOFF_S
            self.tell(Ticked(self.now_s))
            self.answer()


ACTIONS = ["request"] * 3 + [
    "withdraw",
    "join",
    "leave",
    "answer",
    "fail",
    "lose",
    "die",
    "expire",
    "report",
    "tick",
    "tick",
    "repeat",
]


@settings(derandomize=True, max_examples=150, deadline=None)
@given(
    seed=st.integers(0, 2**32 - 1),
    actions=st.lists(st.sampled_from(ACTIONS), max_size=120),
)
def test_each_job_is_delivered_once_for_any_events(
    seed: int, actions: list[str]
) -> None:
    world = World(seed)
    for action in actions:
        getattr(world, action)()
    world.finish()
    assert sorted([*world.delivered, *world.withdrawn]) == sorted(world.jobs)
    for number, delivered in world.delivered.items():
        failed = world.errors.get(number, 0) == MAX_ERRORS
        assert delivered.job == world.jobs[number]
        if delivered.is_deadly:
            assert len(world.killed[number]) >= MAX_DEATHS
            assert not failed
            continue
        assert bool(delivered.reason) == failed
        assert delivered.answer == (b"" if failed else b"a%d" % number)
