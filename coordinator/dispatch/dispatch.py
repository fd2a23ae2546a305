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

An advance of a shard goes to the worker that keeps the shard's state, and has a number
of its own each time that it is assigned. A silent worker loses it to one with room.
"""

from collections.abc import Callable, Iterator

from coordinator.dispatch.assignment import AGENT_OF, Assignment
from coordinator.dispatch.events import (
    Cancel,
    ClientEnded,
    Deliver,
    DispatchCommand,
    DispatchEvent,
    Expired,
    Joined,
    Left,
    Progressed,
    Released,
    Requested,
    Returned,
    ShardSeen,
    Ticked,
    Withdrawn,
)
from coordinator.dispatch.pool import LOOK_S, AgentState, Pending
from schema.errors import UnexpectedEvent
from schema.wire.messages import Crash

MAX_ERRORS = 3
MAX_DEATHS = 3


class Dispatch(Assignment):
    """State machine of jobs; events enter only through ``handle``."""

    def __init__(
        self, numbers: Iterator[int] | None = None, *, allows_drift: bool = False
    ) -> None:
        """Initialise without agents and jobs; arguments as in ``Assignment``."""
        super().__init__(numbers, allows_drift=allows_drift)
        self._highest = -1
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
            ShardSeen: self._seen,
            Released: self._released,
        }

    def handle(self, event: DispatchEvent) -> list[DispatchCommand]:
        """Handle an event and return the commands, in order of execution.

        Late answers, second answers and agents that join or leave twice change
        nothing.

        Raises:
            UnexpectedEvent: a job number that does not ascend or belongs to another
                job, a second advance of a shard, an agent with less than one slot, one
                that joins again with other properties, or a clock that runs backwards.
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
        if event.kind == "worker":
            yield from self._assign_advances()
            yield from self._share(event.agent)

    def _left(self, event: Left) -> Iterator[DispatchCommand]:
        pool = self._pool_of.pop(event.agent, None)
        if pool is None:
            return
        agent = pool.agents.pop(event.agent)
        for home in self.homes.shards.values():
            if home.successor == event.agent:
                home.successor = ""
            if home.holder == event.agent and not (
                home.advance and event.agent in home.advance.holders
            ):
                home.unbind()
        for number, pending in (*agent.held.items(), *agent.advances.items()):
            if self._jobs.get(number) is pending and event.agent in pending.holders:
                pending.lost.add((number, event.agent))
                self._put_back(pending, event.agent)
        yield from self._assign(pool)
        yield from self._assign_advances()

    def _requested(self, event: Requested) -> Iterator[DispatchCommand]:
        job = event.job
        if (known := self._jobs.get(job.number)) and known.job == job:
            return
        home = self._home(job)
        if home and home.advance:
            raise UnexpectedEvent(f"shard {job.shard}: is requested already")
        if job.number <= self._highest:
            raise UnexpectedEvent(
                f"job numbers must ascend: got {job.number} after {self._highest}"
            )
        self._highest = job.number
        pending = self._jobs[job.number] = Pending(job)
        if home:
            home.advance = pending
            yield from self._assign_advances()
            return
        pool = self._pools[AGENT_OF[job.kind]]
        pool.wait(pending)
        yield from self._assign(pool)

    def _seen(self, event: ShardSeen) -> Iterator[DispatchCommand]:
        home = self.homes.of(event.shard)
        home.platform, home.may_drift = event.platform, event.may_drift
        home.client = event.client
        yield from self._assign_advances()

    def _released(self, event: Released) -> Iterator[DispatchCommand]:
        if advance := self.homes.of(event.shard).advance:
            yield from self._close(advance)
        self.homes.deadlines.forget(event.shard)
        del self.homes.shards[event.shard]
        yield from self._assign_advances()

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
        if event.number in agent.advances:
            del agent.advances[event.number]
            agent.occupy()
        elif event.number in agent.held:
            del agent.held[event.number]
        else:
            return
        # A late copy, or an advance that moved, only shows that the agent is free.
        pending = self._jobs.get(event.number)
        if pending and event.agent in pending.holders:
            yield from self._came_back(pending, event, agent)
        pool.offer(event.agent)
        yield from self._assign(pool)
        if pending and pending.job.shard >= 0:
            yield from self._assign_advances()

    def _came_back(
        self, pending: Pending, event: Returned, agent: AgentState
    ) -> Iterator[DispatchCommand]:
        """Deliver a job that came back, or give it to another agent."""
        home, outcome = self._home(pending.job), event.outcome
        if outcome == "ok":
            agent.failures = 0
            self._learn(pending, agent, event.took_s)
            platform = agent.joined.platform
            if home:
                home.has_state, home.platform = True, platform
                if home.successor:
                    home.unbind()
            yield Deliver(pending.job, event.agent, platform, event.answer)
            yield from self._close(pending)
        elif outcome == "unfit":
            agent.unfit_for[pending.job.client] = event.reason
            self._put_back(pending, event.agent)
        elif outcome == "unsent":
            self._put_back(pending, event.agent)
            yield Deliver(pending.job, "", reason=event.reason)
            yield from self._close(pending)
        elif home and outcome == "stateless" and not home.is_whole:
            del pending.holders[event.agent]
            home.has_state = False
        else:
            is_declined = outcome in ("fenced", "cancelled")
            is_fault = not is_declined or event.agent in pending.avoid
            yield from self._fail(pending, event)
            if is_fault:
                self._pool_of[event.agent].back_off(event.agent, self._now_s or 0.0)

    def _expired(self, event: Expired) -> Iterator[DispatchCommand]:
        pending = self._jobs.get(event.number)
        if pending and event.agent in pending.holders:
            pending.repeated.add(event.agent)
            # It may wait in a queue: the next ones wait longer, also if it is lost.
            self._learn_advance(pending, event.agent)
        yield from ()

    def _learn_advance(self, pending: Pending, agent: str) -> None:
        """Note how long an advance took, or has taken so far, unless it is rebuilt."""
        job, home = pending.job, self._home(pending.job)
        if home and not home.is_whole:
            since_s, _ = pending.holders[agent]
            took_s = (self._now_s or 0.0) - since_s
            self.homes.deadlines.learn(job.shard, took_s, job.simulated_s)

    def _learn(self, pending: Pending, agent: AgentState, took_s: float | None) -> None:
        """Note how long an agent took for a job, which it no longer holds.

        ``took_s`` is that of the last request. It is used if it is given and the only
        one. Otherwise the duration is measured between ticks; that includes a pause of
        the coordinator and is too long for short jobs.
        """
        name = agent.joined.agent
        self._learn_advance(pending, name)
        since_s, place = pending.holders.pop(name)
        # An agent that is back may have the answer in memory.
        is_back = (pending.job.number, name) in pending.lost
        if self._now_s is None or is_back or pending.job.shard >= 0:
            return
        if took_s is None or name in pending.repeated:
            took_s = self._now_s - since_s
        self._deadlines.learn(pending.job.kind, took_s, pending.job.simulated_s)
        agent.learn(took_s / place)

    def _fail(self, pending: Pending, event: Returned) -> Iterator[DispatchCommand]:
        """Give a job to another agent, or give it up after several errors.

        A malformed answer is a fault of its agent alone, so it is no such error.
        """
        if event.outcome == "lost":
            pending.lost.add((event.number, event.agent))
        pending.errors += event.outcome in ("error", "stateless")
        if pending.errors == MAX_ERRORS:
            self._put_back(pending, event.agent)
            yield Deliver(pending.job, event.agent, reason=event.reason)
            yield from self._close(pending)
            return
        if event.agent not in pending.avoid:
            pending.avoid = (*pending.avoid, event.agent)
        self._put_back(pending, event.agent)

    def _close(self, pending: Pending) -> Iterator[DispatchCommand]:
        """Remove a job that has ended, and cancel its copies."""
        job = pending.job
        del self._jobs[job.number]
        for number in pending.earlier:
            del self._earlier[number]
        self._pools[AGENT_OF[job.kind]].drop(job.number)
        if job.paired not in self._jobs:
            self._pairs.forget(job)
        if home := self._home(job):
            home.advance, home.misses = None, 0
        for agent in pending.holders:
            yield Cancel(job, agent)

    def _crashed(self, event: Crash) -> Iterator[DispatchCommand]:
        number, agent = event.job.number, event.job.agent
        pending = self._pending(number)
        # A job crashes only a process that had it.
        if pending is None or (number, agent) not in pending.lost:
            return
        pending.killed[agent] = event.cause
        if len(pending.killed) < MAX_DEATHS:
            return
        causes = ", ".join(sorted(set(pending.killed.values())))
        reason = f"ended its own process {MAX_DEATHS} times, by {causes}"
        yield Deliver(pending.job, agent, reason=reason, is_deadly=True)
        yield from self._close(pending)

    def _ticked(self, event: Ticked) -> Iterator[DispatchCommand]:
        if self._now_s is not None and event.now_s < self._now_s:
            raise UnexpectedEvent(f"{event.now_s} s comes after {self._now_s} s")
        self._now_s = event.now_s
        for pool in self._pools.values():
            if pool.end_backoffs(event.now_s):
                yield from self._assign(pool)
        is_look_due = event.now_s >= self._next_look_s
        if is_look_due:
            self._next_look_s = event.now_s + LOOK_S
            yield from self._look(event.now_s)
        self.homes.now_s = event.now_s
        if self.homes.shards:
            self.homes.wait()
            if is_look_due:
                yield from self._look_at_advances(event.now_s)
            yield from self._assign_advances()

    def _progressed(self, event: Progressed) -> Iterator[DispatchCommand]:
        if pool := self._pool_of.get(event.agent):
            pool.agents[event.agent].worked_s = self._now_s or 0.0
            pool.hear(event.agent)
            yield from self._assign(pool)
