"""State machine that assigns jobs to agents.

Each requested job is delivered exactly once, unless it is withdrawn, even if agents
join, leave, die, fail or answer late. An agent holds ``slots + 1`` jobs, so that the
next one is ready, and more of them while many short jobs wait. Jobs with lower numbers
go first, so a lost job is repeated first. The least busy agent gets the job; ties break
on its name.

An agent that fails at a job, loses one without leaving, or declines the same one twice
gets no job until a backoff ends. The backoff grows with consecutive failures, so that a
broken agent cannot empty the queue. One that is unfit for a client, such as without its
plug-ins, gets no more jobs of that client.

Overdue jobs are duplicated on idle agents; the first answer counts. An agent with an
overdue job that reports no progress when it is asked is silent: the jobs that only
silent agents have are assigned to others as well, as lost ones are. A silent agent gets
no more jobs until it is heard. A job that crashed several processes is given up.
"""

from collections.abc import Callable, Iterator
from heapq import heappop

from coordinator.dispatch.events import (
    AgentKind,
    AskProgress,
    Assign,
    Cancel,
    Client,
    ClientEnded,
    Deliver,
    DispatchCommand,
    DispatchEvent,
    Expired,
    Job,
    JobKind,
    Joined,
    Left,
    Progressed,
    Requested,
    Returned,
    Ticked,
    Withdrawn,
)
from coordinator.dispatch.faults import PeerFaults
from coordinator.dispatch.pool import (
    FIRST_S,
    LOOK_S,
    AgentState,
    Deadlines,
    PairedJobs,
    Pending,
    Pool,
)
from schema.errors import MalformedMessage, UnexpectedEvent
from schema.wire.codec import fingerprint
from schema.wire.messages import Crash

AGENT_OF: dict[JobKind, AgentKind] = {
    "vet": "analyzer",
    "evaluate": "worker",
    "call": "worker",
}
MAX_ERRORS = 3
MAX_DEATHS = 3
LEAST_S = 1.0
"""A job is never late before this time [s]: a second copy would cost more."""
CALL_S = 2.0 * FIRST_S
"""No agent is asked about a call before this time [s]: calls differ in duration."""
COPY_GROWTH = 16.0
"""Growth of the deadline with each copy at agents that report progress."""
VETS_AT_HAND = 16
"""Vettings that an analyzer holds beyond the current one: some milliseconds' work."""


class Dispatch:
    """State machine of jobs; events enter only through ``handle``.

    Attributes:
        workers: the workers and their load, which the arenas share.
    """

    def __init__(self, faults: PeerFaults | None = None) -> None:
        """Initialise without agents and jobs.

        Args:
            faults: counts unfit and late answers; None: counts of its own.
        """
        self._faults = faults or PeerFaults()
        self._jobs: dict[int, Pending] = {}
        self.workers = Pool()
        self._pools: dict[AgentKind, Pool] = {
            "worker": self.workers,
            "analyzer": Pool(VETS_AT_HAND),
        }
        self._pool_of: dict[str, Pool] = {}
        self._deadlines = Deadlines(LEAST_S)
        self._next_look_s = 0.0
        self._pairs = PairedJobs()
        self._highest = -1
        self._now_s: float | None = None
        self._handlers: dict[type, Callable[..., Iterator[DispatchCommand]]] = {
            Joined: self._joined,
            Left: self._left,
            Requested: self._requested,
            Withdrawn: self._withdrawn,
            ClientEnded: self._ended,
            Returned: self._returned,
            Expired: self._expired,
            Crash: self._crashed,
            Ticked: self._ticked,
            Progressed: self._progressed,
        }

    @property
    def pending(self) -> int:
        """Number of jobs that are requested and not delivered."""
        return len(self._jobs)

    def client(self, number: int) -> Client | None:
        """Return the client of a job; None if the job has ended."""
        pending = self._jobs.get(number)
        return pending.job.client if pending else None

    def agents(self, kind: AgentKind) -> int:
        """Return the number of agents of a kind."""
        return len(self._pools[kind].agents)

    def fit(self, kind: AgentKind, client: Client) -> set[str]:
        """Return the names of the agents of a kind that can do a client's jobs."""
        return set(self._pools[kind].fit(client))

    def unfit(self) -> dict[str, str]:
        """Return why agents cannot do the jobs of some client, by name."""
        states = self._states()
        return {a.joined.agent: why for a in states for why in a.unfit_for.values()}

    def names(self, kind: AgentKind) -> list[str]:
        """Return the names of the agents of a kind, ascending."""
        return sorted(self._pools[kind].agents)

    def waiting(self, kind: AgentKind) -> int:
        """Return the number of jobs of a kind of agent that are not assigned."""
        return len(self._pools[kind].waiting)

    def assigned(self, kind: AgentKind) -> int:
        """Return the number of jobs that the agents of a kind hold."""
        return sum(len(agent.held) for agent in self._pools[kind].agents.values())

    def silent(self) -> dict[str, int]:
        """Return how many jobs and advances the silent agents hold, by their names."""
        silent = [a for a in self._states() if a.is_silent and (a.held or a.advances)]
        return {a.joined.agent: len(a.held) + len(a.advances) for a in silent}

    def _states(self) -> list[AgentState]:
        # Copies, as in ``Pool.fit``.
        return [a for each in self._pools.values() for a in list(each.agents.values())]

    @property
    def credits(self) -> int:
        """How many jobs all workers together hold while enough jobs wait."""
        workers = self.workers.agents.values()
        return sum(worker.joined.slots + 1 for worker in workers)

    def platform(self, agent: str) -> str:
        """Return the platform of an agent; empty once it has left."""
        pool = self._pool_of.get(agent)
        return pool.agents[agent].joined.platform if pool else ""

    def wait_s(self, job: Job) -> float:
        """Return for how long the network waits for the reply to a job [s]."""
        # Calls differ in duration. One that takes longer is sent again, and its worker
        # goes on with it.
        return self._deadlines.wait_s(job.kind, job.simulated_s)

    def payload(self, number: int, agent: str) -> bytes | None:
        """Return the request of a job that an agent has; None: it has no such job."""
        pending = self._jobs.get(number)
        return pending.job.payload if pending and agent in pending.holders else None

    @property
    def pause_s(self) -> float:
        """Time for which answers may collect before a worker runs out of jobs [s]."""
        return self.workers.pause_s

    @property
    def wake_s(self) -> float | None:
        """Time at which the next ``Ticked`` is needed [s]; None: it is not."""
        wakes = [pool.wake_s for pool in self._pools.values()]
        return min((wake_s for wake_s in wakes if wake_s is not None), default=None)

    def handle(self, event: DispatchEvent) -> list[DispatchCommand]:
        """Handle an event and return the commands, in order of execution.

        Late answers, second answers and agents that join or leave twice change
        nothing.

        Raises:
            UnexpectedEvent: a job number that does not ascend or belongs to another
                job, an agent with less than one slot, an agent that joins again with
                other properties, or a clock that runs backwards.
        """
        return list(self._handlers[type(event)](event))

    def _joined(self, event: Joined) -> Iterator[DispatchCommand]:
        if event.slots < 1:
            raise UnexpectedEvent(f"{event.agent}: slots must be >= 1: {event.slots}")
        if pool := self._pool_of.get(event.agent):
            known = pool.agents[event.agent].joined
            if known != event:
                raise UnexpectedEvent(f"joins as {event}, is there as {known}")
            return
        pool = self._pool_of[event.agent] = self._pools[event.kind]
        pool.agents[event.agent] = AgentState(event)
        pool.offer(event.agent)
        yield from self._assign(pool)

    def _left(self, event: Left) -> Iterator[DispatchCommand]:
        pool = self._pool_of.pop(event.agent, None)
        if pool is None:
            return
        for number, pending in pool.agents.pop(event.agent).held.items():
            if number in self._jobs:
                pending.lost[event.agent] += 1
                self._put_back(pending, event.agent)
        yield from self._assign(pool)

    def _put_back(self, pending: Pending, agent: str) -> None:
        """Take a job from an agent; it waits again if no other agent works at it."""
        del pending.holders[agent]
        pool = self._pools[AGENT_OF[pending.job.kind]]
        if not _working(pending, pool):
            pool.wait(pending)

    def _requested(self, event: Requested) -> Iterator[DispatchCommand]:
        number = event.job.number
        if (known := self._jobs.get(number)) and known.job == event.job:
            return
        if number <= self._highest:
            raise UnexpectedEvent(
                f"job numbers must ascend: got {number} after {self._highest}"
            )
        pool = self._pools[AGENT_OF[event.job.kind]]
        self._highest = number
        pending = self._jobs[number] = Pending(event.job)
        pool.wait(pending)
        yield from self._assign(pool)

    def _withdrawn(self, event: Withdrawn) -> Iterator[DispatchCommand]:
        if pending := self._jobs.get(event.number):
            yield from self._close(pending)

    def _ended(self, event: ClientEnded) -> Iterator[DispatchCommand]:
        jobs = [j for j in self._jobs.values() if j.job.client == event.client]
        for pending in jobs:
            yield from self._close(pending)
        for agent in self._states():
            agent.unfit_for.pop(event.client, None)

    def _returned(self, event: Returned) -> Iterator[DispatchCommand]:
        pool = self._pool_of.get(event.agent)
        if pool is None:
            return
        agent = pool.agents[event.agent]
        if event.outcome != "lost":
            pool.hear(event.agent)
        is_advance = event.number in agent.advances
        if is_advance:
            del agent.advances[event.number]
            agent.occupy()
        elif event.number in agent.held:
            del agent.held[event.number]
        else:
            self._note_late(event)
            return
        # A late copy only shows that the agent is free.
        pending = self._jobs.get(event.number)
        if pending and event.outcome == "unfit":
            self._faults.note("refused", event.agent, event.reason)
            agent.unfit_for[pending.job.client] = event.reason
            self._put_back(pending, event.agent)
        elif pending:
            answer, reason = self._read(pending.job, event)
            if event.outcome == "ok" and not reason:
                agent.failures = 0
                self._learn(pending, agent, event.took_s)
                platform = agent.joined.platform
                yield Deliver(pending.job, event.agent, platform, answer)
                yield from self._close(pending)
            else:
                is_declined = event.outcome in ("fenced", "cancelled")
                is_fault = not is_declined or event.agent in pending.avoid
                yield from self._fail(pending, event, reason)
                if is_fault:
                    pool.back_off(event.agent, self._now_s or 0.0)
        elif not is_advance:
            self._note_late(event)
        pool.offer(event.agent)
        yield from self._assign(pool)

    def _expired(self, event: Expired) -> Iterator[DispatchCommand]:
        pending = self._jobs.get(event.number)
        if pending and event.agent in pending.holders:
            pending.repeated.add(event.agent)
        yield from ()

    def _note_late(self, event: Returned) -> None:
        if event.outcome == "ok":
            self._faults.note("late", event.agent, f"job {event.number}")

    def _read(self, job: Job, event: Returned) -> tuple[object, str]:
        """Return the decoded answer, or the reason why there is none."""
        if event.outcome != "ok":
            if event.outcome == "error":
                self._faults.note("refused", event.agent, event.reason)
            return None, event.reason
        try:
            return job.read(event.answer), ""
        except MalformedMessage as error:
            self._faults.note("malformed", event.agent, str(error))
            return None, str(error)

    def _learn(self, pending: Pending, agent: AgentState, took_s: float | None) -> None:
        """Note how long an agent took for a job, which it no longer holds.

        ``took_s`` is that of the last request. It is used if it is given and the only
        one. Otherwise the duration is measured between ticks; that includes a pause of
        the coordinator and is too long for short jobs.
        """
        name = agent.joined.agent
        since_s, place = pending.holders.pop(name)
        # An agent that is back may have the answer in memory.
        if self._now_s is None or name in pending.lost:
            return
        if took_s is None or name in pending.repeated:
            took_s = self._now_s - since_s
        self._deadlines.learn(pending.job.kind, took_s, pending.job.simulated_s)
        agent.learn(took_s / place)

    def _fail(
        self, pending: Pending, event: Returned, reason: str
    ) -> Iterator[DispatchCommand]:
        """Give a job to another agent, or give it up after several errors.

        A malformed answer is a fault of its agent alone, so it is no such error.
        """
        if event.outcome == "lost":
            pending.lost[event.agent] += 1
        pending.errors += event.outcome == "error"
        if pending.errors == MAX_ERRORS:
            del pending.holders[event.agent]
            yield Deliver(pending.job, event.agent, reason=reason)
            yield from self._close(pending)
            return
        if event.agent not in pending.avoid:
            pending.avoid = (*pending.avoid, event.agent)
        self._put_back(pending, event.agent)

    def _close(self, pending: Pending) -> Iterator[DispatchCommand]:
        """Remove a job that has ended, and cancel its copies."""
        job = pending.job
        del self._jobs[job.number]
        self._pools[AGENT_OF[job.kind]].drop(job.number)
        if job.paired not in self._jobs:
            self._pairs.forget(job)
        for agent in pending.holders:
            yield Cancel(job, agent)

    def _crashed(self, event: Crash) -> Iterator[DispatchCommand]:
        crashed = event.job
        pending = self._jobs.get(crashed.number)
        if pending is None or pending.job.client != (crashed.run, crashed.epoch):
            return
        is_same = crashed.request == fingerprint(pending.job.payload)
        if crashed.agent not in pending.lost or not is_same:
            # A job crashes only a process that had it. That process may have died of
            # another one's request with the name of this job.
            self._faults.note("death", crashed.agent, f"job {crashed.number}")
            return
        pending.killed[crashed.agent] = event.cause
        if len(pending.killed) < MAX_DEATHS:
            return
        causes = ", ".join(sorted(set(pending.killed.values())))
        reason = f"ended its own process {MAX_DEATHS} times, by {causes}"
        yield Deliver(pending.job, crashed.agent, reason=reason, is_deadly=True)
        yield from self._close(pending)

    def _ticked(self, event: Ticked) -> Iterator[DispatchCommand]:
        if self._now_s is not None and event.now_s < self._now_s:
            raise UnexpectedEvent(f"{event.now_s} s comes after {self._now_s} s")
        self._now_s = event.now_s
        for pool in self._pools.values():
            if pool.end_backoffs(event.now_s):
                yield from self._assign(pool)
        if event.now_s >= self._next_look_s:
            self._next_look_s = event.now_s + LOOK_S
            yield from self._look(event.now_s)

    def _progressed(self, event: Progressed) -> Iterator[DispatchCommand]:
        if pool := self._pool_of.get(event.agent):
            pool.agents[event.agent].worked_s = self._now_s or 0.0
            pool.hear(event.agent)
            yield from self._assign(pool)

    def _look(self, now_s: float) -> Iterator[DispatchCommand]:
        """Find silent agents; duplicate overdue jobs on idle agents, oldest first."""
        for kind, pool in self._pools.items():
            for name, agent in pool.agents.items():
                if agent.held:
                    yield from self._judge(pool, name, now_s)
            yield from self._assign(pool)
            idle = pool.idle()
            for pending in list(self._jobs.values()) if idle else ():
                if AGENT_OF[pending.job.kind] == kind:
                    yield from self._copy(pending, pool, idle, now_s)

    def _judge(self, pool: Pool, name: str, now_s: float) -> Iterator[DispatchCommand]:
        """Ask an agent if its oldest job is overdue; give up on it if it is silent."""
        agent = pool.agents[name]
        oldest = next(iter(agent.held.values()))
        since_s, _ = oldest.holders[name]
        limit_s = self._limit_s(oldest.job)
        if oldest.job.simulated_s is None:
            limit_s = max(limit_s, CALL_S)
        # Its reply may have come since the last look, so the user is told at the next.
        if agent.is_silent:
            fit = pool.fit(oldest.job.client)
            others = (each for each in fit if not pool.agents[each].is_silent)
            yield from pool.tell(name, now_s - since_s, min(others, default=""))
        if pool.judge(name, since_s, limit_s, now_s) == "ask":
            yield AskProgress(name)
        if agent.is_silent:
            for number, pending in agent.held.items():
                if number in self._jobs and not _working(pending, pool):
                    pool.wait(pending)

    def _limit_s(self, job: Job) -> float:
        return self._deadlines.limit_s(job.kind, job.simulated_s)

    def _copy(
        self, pending: Pending, pool: Pool, idle: list[str], now_s: float
    ) -> Iterator[Assign]:
        """Give an overdue job to an idle agent, which is removed from the list."""
        since_s = [pending.holders[name][0] for name in _working(pending, pool)]
        # Of agents that report progress any may lie, but hardly all.
        limit_s = self._limit_s(pending.job) * COPY_GROWTH ** (len(since_s) - 1)
        if not since_s or now_s - max(since_s) <= limit_s:
            return
        client, avoid = pending.job.client, self._pairs.avoided(pending)
        for name in idle:
            if name not in pending.holders and pool.may_take(name, client, avoid):
                idle.remove(name)
                yield self._give(pending, pool, name)
                return

    def _give(self, pending: Pending, pool: Pool, name: str) -> Assign:
        """Assign a job to an agent."""
        job = pending.job
        self._pairs.note(job, name)
        agent = pool.agents[name]
        agent.held[job.number] = pending
        place = max(1.0, len(agent.held) / agent.joined.slots)
        pending.holders[name] = (self._now_s or 0.0, place)
        if not _working(pending, pool):
            pool.wait(pending)
        pool.offer(name)
        return Assign(job, name)

    def _assign(self, pool: Pool) -> Iterator[DispatchCommand]:
        """Assign the jobs that can be assigned."""
        passed: list[str] = []
        while pool.waiting and (name := pool.best()):
            pending = pool.take(name, self._pairs.avoided)
            if pending is None:
                passed.append(name)
                heappop(pool.free)
                continue
            yield self._give(pending, pool, name)
        for name in passed:
            pool.offer(name)


def _working(pending: Pending, pool: Pool) -> list[str]:
    """Return the agents that have a job and are not silent."""
    return [name for name in pending.holders if not pool.agents[name].is_silent]
