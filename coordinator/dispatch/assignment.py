"""Jobs, advances and agents at present, and which agent gets which job."""

from collections.abc import Iterator
from dataclasses import replace
from heapq import heappop
from itertools import count

from coordinator.dispatch.events import (
    AgentKind,
    AskProgress,
    Assign,
    Cancel,
    Client,
    Crowded,
    DispatchCommand,
    Job,
    JobKind,
)
from coordinator.dispatch.homes import Home, Homes
from coordinator.dispatch.pool import (
    FIRST_S,
    LONGEST_WAIT_S,
    AgentState,
    Deadlines,
    PairedJobs,
    Pending,
    Pool,
)

AGENT_OF: dict[JobKind, AgentKind] = {
    "breed": "analyzer",
    "evaluate": "worker",
    "call": "worker",
    "advance": "worker",
}
LEAST_S = 1.0
"""A job is never late before this time [s]: a second copy would cost more."""
BIRTHS_AT_HAND = 16
"""Births that an analyzer holds beyond the current one: some milliseconds' work."""
CALL_S = 2.0 * FIRST_S
"""No agent is asked about a call before this time [s]: calls differ in duration."""
COPY_GROWTH = 16.0
"""Growth of the deadline with each copy at agents that report progress."""


class Assignment:
    """Jobs and agents at present, and the assignment of the ones to the others.

    Attributes:
        workers: the workers and their load.
        homes: the workers of arena shards.
    """

    def __init__(
        self, numbers: Iterator[int] | None = None, *, allows_drift: bool = False
    ) -> None:
        """Initialise without agents and jobs.

        Args:
            numbers: of jobs, each used once; None: from 1 on, for advances alone.
            allows_drift: a shard may move to another platform if its own is gone.
        """
        self._numbers = numbers or count(1)
        self._jobs: dict[int, Pending] = {}
        self._earlier: dict[int, Pending] = {}
        self.workers = Pool()
        self.homes = Homes(self.workers, allows_drift=allows_drift)
        self._pools: dict[AgentKind, Pool] = {
            "worker": self.workers,
            "analyzer": Pool(BIRTHS_AT_HAND),
        }
        self._pool_of: dict[str, Pool] = {}
        self._deadlines = Deadlines(LEAST_S)
        self._next_look_s = 0.0
        self._pairs = PairedJobs()
        self._now_s: float | None = None

    @property
    def pending(self) -> int:
        """Number of jobs that are requested and not delivered."""
        return len(self._jobs)

    def job(self, number: int) -> Job | None:
        """Return a job, also by a number that it had before; None if it has ended."""
        pending = self._pending(number)
        return pending.job if pending else None

    def has(self, agent: str, number: int) -> bool:
        """Return whether an agent has a job that is not delivered yet."""
        pending = self._jobs.get(number)
        return pending is not None and agent in pending.holders

    def has_lost(self, agent: str, number: int) -> bool:
        """Return whether an agent had a job and gave no reply."""
        pending = self._pending(number)
        return pending is not None and (number, agent) in pending.lost

    def _pending(self, number: int) -> Pending | None:
        return self._jobs.get(number) or self._earlier.get(number)

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

    def wait_s(self, assigned: Assign) -> float:
        """Return for how long the network waits for the reply to a job [s]."""
        job = assigned.job
        # A rebuild may take very much longer than an advance.
        if assigned.is_whole:
            return LONGEST_WAIT_S
        if job.shard >= 0:
            return self.homes.deadlines.wait_s(job.shard, job.simulated_s)
        # Calls differ in duration. One that takes longer is sent again, and its worker
        # goes on with it.
        return self._deadlines.wait_s(job.kind, job.simulated_s)

    @property
    def pause_s(self) -> float:
        """Time for which answers may collect before a worker runs out of jobs [s]."""
        return self.workers.pause_s

    @property
    def wake_s(self) -> float | None:
        """Time at which the next ``Ticked`` is needed [s]; None: it is not."""
        wakes = [pool.wake_s for pool in self._pools.values()]
        if self.homes.shards:
            wakes.append(self.homes.wake_s)
        return min((wake_s for wake_s in wakes if wake_s is not None), default=None)

    def _look(self, now_s: float) -> Iterator[DispatchCommand]:
        """Find silent agents; duplicate overdue jobs on idle agents, oldest first."""
        for kind, pool in self._pools.items():
            for name, agent in pool.agents.items():
                if agent.held:
                    yield from self._judge(pool, name, now_s)
            yield from self._assign(pool)
            idle = pool.idle()
            for pending in list(self._jobs.values()) if idle else ():
                if AGENT_OF[pending.job.kind] == kind and pending.job.shard < 0:
                    yield from self._copy(pending, pool, idle, now_s)

    def _look_at_advances(self, now_s: float) -> Iterator[DispatchCommand]:
        """Move advances from silent workers to others with room."""
        pool, late = self.workers, list[tuple[int, Home, float]]()
        for shard, home in sorted(self.homes.shards.items()):
            if home.advance is None or home.is_waiting:
                continue
            since_s, _ = home.advance.holders[home.holder]
            limit_s = self.homes.limit_s(shard)
            verdict = pool.judge(home.holder, since_s, limit_s, now_s)
            if verdict == "ask":
                yield AskProgress(home.holder)
            elif verdict == "silent":
                late.append((shard, home, since_s))
        for shard, home, since_s in late:
            to = self.homes.with_room(home)
            yield from pool.tell(home.holder, now_s - since_s, to)
            if to and (advance := home.advance):
                home.misses += to in advance.avoid
                advance.avoid = (*advance.avoid, home.holder)
                yield from self._move(shard, to)

    def _move(self, shard: int, to: str) -> Iterator[DispatchCommand]:
        """Take a shard from its worker, with the advance that is assigned."""
        home = self.homes.shards[shard]
        home.successor = to
        if home.advance and home.holder in home.advance.holders:
            yield Cancel(home.advance.job, home.holder)
            self._put_back(home.advance, home.holder)
        else:
            home.unbind()

    def _share(self, newcomer: str) -> Iterator[DispatchCommand]:
        """Give a worker that has joined shards of those that hold more."""
        while (shard := self.homes.excess(newcomer)) is not None:
            home = self.homes.shards[shard]
            if home.has_state and home.advance and not home.is_waiting:
                home.successor = newcomer
            else:
                yield from self._move(shard, newcomer)
                yield from self._assign_advances()

    def _assign_advances(self) -> Iterator[DispatchCommand]:
        """Assign the advances whose shards have a worker."""
        for shard in self.homes.settle():
            if isinstance(shard, Crowded):
                yield shard
            else:
                yield self._give_advance(self.homes.shards[shard])

    def _give_advance(self, home: Home) -> Assign:
        """Send a shard's advance to its holder."""
        pending, name = home.advance, home.holder
        assert pending is not None
        if pending.has_been_assigned:
            number = next(self._numbers)
            self._earlier[pending.job.number] = self._jobs.pop(pending.job.number)
            pending.earlier.append(pending.job.number)
            pending.job = replace(pending.job, number=number)
            self._jobs[number] = pending
        pending.has_been_assigned = True
        home.drifts_at_s = None
        home.is_whole = not home.has_state
        self.homes.rebuilt += home.is_whole and bool(home.platform)
        worker = self.workers.agents[name]
        pending.holders[name] = (self._now_s or 0.0, 1.0)
        worker.advances[pending.job.number] = pending
        worker.occupy()
        self.workers.offer(name)
        return Assign(pending.job, name, worker.joined.platform, home.is_whole)

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

    def _put_back(self, pending: Pending, agent: str) -> None:
        """Take a job from an agent; it waits again if no other agent works at it."""
        del pending.holders[agent]
        if home := self._home(pending.job):
            home.unbind()
            return
        pool = self._pools[AGENT_OF[pending.job.kind]]
        if not _working(pending, pool):
            pool.wait(pending)

    def _home(self, job: Job) -> Home | None:
        return self.homes.of(job.shard) if job.shard >= 0 else None


def _working(pending: Pending, pool: Pool) -> list[str]:
    """Return the agents that have a job and are not silent."""
    return [name for name in pending.holders if not pool.agents[name].is_silent]
